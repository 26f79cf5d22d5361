"""The search for the worst: finds what random trials miss, keeps what it found, and says when it found little."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.sim.campaign.worst.search import LEAST, NEAR, Evaluate, Found, search_worst

pytestmark = pytest.mark.skipif(find_spec("cma") is None, reason="no cma")  # to import it takes a second
D = 12
NEEDLE = np.linspace(0.15, 0.85, D)


def people(distance: Callable[[np.ndarray], float]) -> Evaluate:
    """Encounters with a distance as a function of their point."""

    def evaluate(points: np.ndarray) -> list[dict[str, Any]]:
        found = [distance(u) for u in points]
        return [
            {"contact": bool(x <= 0.0), "distance": float(x), "search": -float(x), "distance_time": 20.0 * float(u[1])}
            for x, u in zip(found, points, strict=True)
        ]

    return evaluate


def needle(u: np.ndarray) -> float:
    """Contact within 0.25 of a point: 1e-9 of the cube; from everywhere it is seen where it gets nearer."""
    return float(np.linalg.norm(u - NEEDLE)) - 0.25


def search(distance: Callable[[np.ndarray], float], budget: int = 1000, seed: int = 0, **options: Any) -> Found:
    return search_worst(people(distance), D, budget, seed, **options)


def test_a_needle_is_found_that_random_trials_miss() -> None:
    found = search(needle)
    assert found.worst.row["contact"]
    assert not found.random
    assert found.worst_random.row["distance"] > 0.2
    assert len(found.new) >= 1


def test_every_case_that_is_kept_is_near_and_can_be_played_again() -> None:
    found = search(needle)
    for case in (*found.searched, *found.random):
        assert case.near
        assert case.row["distance"] < NEAR
        assert needle(np.array(case.u)) == case.row["distance"]
        assert all(0.0 <= x <= 1.0 for x in case.u)
    harms = [case.harm for case in found.searched]
    assert harms == sorted(harms, reverse=True)
    assert found.worst == found.searched[0]


def test_new_cases_are_of_other_kinds_than_random_ones_or_worse_than_all_of_theirs() -> None:
    found = search(lambda u: float(np.abs(u - 0.3)[:3].max()) - 0.1)  # random trials find it, too
    assert found.random
    assert len({case.kind for case in found.new}) == len(found.new)
    for case in found.new:
        assert case.climb >= 0
        assert all(case.harm > other.harm for other in found.random if other.kind == case.kind)


def test_random_cases_are_no_discovery_beside_random_ones() -> None:
    """Where no climb helps, next to nothing is new, however many cases are near."""
    found = search(lambda u: 0.02, 400)
    assert len(found.searched) == len(found.random) == 400
    assert len(found.new) <= 3


def test_what_chooses_is_kept_in_a_climb_and_differs_between_climbs() -> None:
    free = np.arange(D) > 0
    seen: list[np.ndarray] = []

    def two(u: np.ndarray) -> float:
        seen.append(u)
        return float(np.linalg.norm((u - (NEEDLE if u[0] < 0.5 else 1.0 - NEEDLE))[1:])) - 0.25

    found = search(two, 2000, continuous=free)
    assert len(found.new) >= 1
    explored = {u[0] for u in seen[:500]}
    assert {u[0] for u in seen[500:2000]} <= explored  # climbs never change it
    assert len({u[0] for u in seen[500:2000]}) >= 4  # several starts


def test_the_same_seed_finds_the_same_whatever_else_is_random() -> None:
    first = search(needle, 200)
    np.random.default_rng().random()
    np.random.seed(3)  # noqa: NPY002 - what a user's program may do
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    assert search(needle, 200) == first
    assert (np.random.get_state()[1] == state).all()  # noqa: NPY002 - nor is it touched
    assert search(needle, 200, seed=1).worst != first.worst


@pytest.mark.parametrize("budget", [LEAST, 101, 500])
def test_the_budget_is_spent_and_not_exceeded(budget: int) -> None:
    heard: list[tuple[int, int]] = []
    count = [0]

    def counted(u: np.ndarray) -> float:
        count[0] += 1
        return needle(u)

    search(counted, budget, progress=lambda *now: heard.append(now))
    assert count[0] == 2 * budget
    assert heard[-1] == (2 * budget, 2 * budget)
    assert [now for now, _ in heard] == sorted(now for now, _ in heard)


def test_when_little_is_found_it_is_said() -> None:
    found = search(lambda u: 1.0 + float(u[0]), 100)
    assert found.searched == found.random == found.new == ()
    assert "The search could not find 10." in found.sentence
    assert found.to_dict()["cases"] == []


def test_figures_that_are_no_numbers_and_flat_ones_do_not_stop_it() -> None:
    assert search(lambda u: float("nan") if u[0] > 0.5 else needle(u), 400).worst.row["distance"] < 0.5
    assert search(lambda u: 0.02, 200).budget == 200


@pytest.mark.parametrize("kept", [0, 1])
def test_a_cube_with_next_to_nothing_to_climb_in_is_searched(kept: int) -> None:
    assert search(needle, 100, continuous=np.arange(D) < kept).budget == 100


def test_what_cannot_be_searched_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigurationError, match="budget = 3"):
        search(needle, 3)
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(MissingExtraError, match=r"qpsafe\[campaign\]"):
        search(needle, 100)
