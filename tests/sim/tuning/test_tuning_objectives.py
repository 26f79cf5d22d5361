"""One number for harm, that grows with energy and falls with distance; estimates that are right where they can be."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.sim.campaign.trials.harm import harm
from qpsafe.sim.tuning.objectives import Outcome, mean, score

SHARES, DISTANCES = st.floats(0.0, 1e6), st.floats(-1.0, 10.0)


@given(SHARES, SHARES, DISTANCES, DISTANCES)
def test_more_energy_and_less_distance_are_more_harm(a: float, b: float, near: float, far: float) -> None:
    a, b, near, far = *sorted((a, b)), *sorted((near, far))
    assert harm(a, near) <= harm(b, near)
    assert harm(a, far) <= harm(a, near)
    assert 0.0 <= harm(b, near) <= 1.25


def test_no_contact_and_a_blow_without_end_are_numbers_too() -> None:
    assert harm(math.nan, 0.1) == harm(0.0, 0.1) == pytest.approx(0.25 / math.e)
    assert harm(math.inf, 0.0) == 1.25
    assert harm(1.0, -0.3) == 0.75


def outcome(harm: float = 0.1, lost: float = 1.0, **other: float) -> Outcome:
    return Outcome(**({"contact": False, "furniture": False, "itself": False, "excess": 0.0, "bad": 0, "reversals": 10}
                      | {"harm": harm, "lost": lost} | other))  # type: ignore[arg-type]  # fmt: skip


RUNS = st.lists(st.builds(outcome, st.floats(0, 1), st.floats(0, 9)), min_size=12, max_size=12)


@given(RUNS, RUNS, st.integers(1, 12))
def test_an_estimate_is_the_mean_where_all_is_played_and_exact_for_a_shift(
    mine: list[Outcome], reference: list[Outcome], count: int
) -> None:
    whole = score({0: mine}, {0: reference})
    assert whole.harm == pytest.approx(mean(mine, "harm"), abs=1e-12)
    assert whole.lost == pytest.approx(mean(mine, "lost"), abs=1e-12)
    shifted = [o._replace(harm=o.harm + 0.25) for o in reference]
    assert score({0: shifted[:count]}, {0: reference}).harm == pytest.approx(mean(shifted, "harm"), abs=1e-12)


def test_constraints_are_kept_by_the_present_values_and_broken_by_what_is_worse() -> None:
    reference = {0: [outcome()] * 6, 2: [outcome(reversals=12)] * 3}
    assert score(reference, reference).violation == 0.0
    for name, worse in {
        "limits": {"excess": 1e-6}, "furniture": {"furniture": True}, "self": {"itself": True}, "bad ticks": {"bad": 1},
        "chatter": {"reversals": 15},
    }.items():  # fmt: skip
        found = score({0: [outcome(**worse)] * 6}, reference)  # type: ignore[arg-type]
        assert [key for key, value in found.constraints.items() if value > 0.0] == [name]
    lagged = score({0: [outcome()] * 6, 2: [outcome(reversals=21)] * 3}, reference)
    assert [key for key, value in lagged.constraints.items() if value > 0.0] == ["lag 2"]
    assert score({0: [outcome()] * 6, 2: [outcome(excess=0.1)] * 3}, reference).constraints["limits"] == 0.1
