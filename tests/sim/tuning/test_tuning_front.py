"""The front holds what nothing dominates; the choice is on it, and does not depend on units."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.sim.tuning.front import PREFERENCES, Objectives, front, knee, ranks

NUMBERS = st.integers(0, 40).map(float)
POINTS = st.lists(st.builds(Objectives, NUMBERS, NUMBERS), min_size=1, max_size=30)


@given(POINTS)
def test_the_front_is_what_no_point_dominates_each_place_once(points: list[Objectives]) -> None:
    found = [points[k] for k in front(points)]
    free = {mine for mine in points if not any(other.dominates(mine) for other in points)}
    assert set(found) == free
    assert len(found) == len(free)
    assert found == sorted(found)  # harm grows
    assert [p.lost for p in found] == sorted((p.lost for p in found), reverse=True)


@given(POINTS)
def test_what_none_dominates_has_rank_0_and_ranks_count(points: list[Objectives]) -> None:
    for mine, rank in zip(points, ranks(points), strict=True):
        assert rank == len([other for other in points if other.dominates(mine)])


@given(POINTS, st.sampled_from(sorted(PREFERENCES)), st.integers(-3, 3), st.integers(-3, 3))
def test_the_choice_does_not_depend_on_units(points: list[Objectives], prefer: str, a: int, b: int) -> None:
    best = [points[k] for k in front(points)]
    scaled = [Objectives(p.harm * 2.0**a, p.lost * 2.0**b) for p in best]
    chosen = knee(best, points[0], prefer)
    assert 0 <= chosen < len(best)
    assert knee(scaled, Objectives(points[0].harm * 2.0**a, points[0].lost * 2.0**b), prefer) == chosen


@given(POINTS)
def test_a_balanced_choice_costs_nobody_anything_if_that_is_possible(points: list[Objectives]) -> None:
    best = [points[k] for k in front(points)]
    chosen = best[knee(best, points[0], "balanced")]
    if any(p.dominates(points[0]) for p in best):
        assert chosen.dominates(points[0])
    else:
        assert chosen in best


@given(POINTS)
def test_who_prefers_safety_gets_no_more_harm_than_who_prefers_work(points: list[Objectives]) -> None:
    best = [points[k] for k in front(points)]
    safe, quick = (best[knee(best, points[0], prefer)] for prefer in ("safety", "work"))
    assert safe.harm <= quick.harm
    assert quick.lost <= safe.lost


def test_a_preference_that_is_none_is_named() -> None:
    with pytest.raises(ConfigurationError, match=r"prefer.*'speed'.*safety, balanced, work"):
        knee([Objectives(0.0, 0.0)], Objectives(1.0, 1.0), "speed")
