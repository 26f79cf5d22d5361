"""Ages and ranges: no clock, however wrong, makes a silent sensor look alive; what is out of range is out of sight."""

from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sensing.health import HEALTHY, IMPOSSIBLE_AGE
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing

ROBOT = qpsafe.load_robot("irb140")
SPOTS = qpsafe.load_spots(ROBOT)
assert SPOTS is not None
K, DT = len(SPOTS), 0.004
BARE = SensingRules(self_detection=False)
#: A dead process must be known to be dead after this: the age limit and the tolerance, twice, since a clock that is set
#: back once looks like a newer reading, and the time a spot has to die.
NOTICED = 2.0 * (BARE.max_age + BARE.clock_error) + BARE.dead_after + 2 * DT


def sensing_of(rules: SensingRules = BARE) -> DistanceSensing:
    assert SPOTS is not None
    return DistanceSensing(ROBOT, SPOTS, DT, rules)


def feed(sensing: DistanceSensing, q: np.ndarray, distances: np.ndarray, ages: np.ndarray) -> Any:
    state = ROBOT.at(q)
    return sensing.update(state, state.wire(np.zeros(ROBOT.nq)), distances, ages)


@settings(max_examples=some(10, of=60), deadline=None)
@given(
    st.floats(-1e9, 1e9) | st.floats(-0.1, 0.1),
    st.floats(-1e3, 1e3) | st.floats(-0.05, 0.05),
    st.integers(0, 40),
    st.integers(0, 40),
)
def test_a_process_that_dies_is_noticed_whatever_its_clock_says(
    skew: float, step: float, before: int, jump: int
) -> None:
    """Its clock differs by `skew`, and is set forth or back at some moment; ages are what the loop makes of it."""
    sensing = sensing_of()
    for k in range(before + round(NOTICED / DT) + 1):
        silent = DT * max(k - before, 0)
        age = silent + skew + (step if k >= jump else 0.0)
        seen = feed(sensing, ROBOT.home, np.full(K, 0.5), np.full(K, age))
        if silent >= NOTICED:
            assert seen.too_many
            assert sensing.health.dead.all()


@settings(max_examples=some(10, of=60), deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-0.009, 0.009), st.integers(1, 6))
def test_an_honest_clock_is_believed(seed: int, skew: float, period: int) -> None:
    """Readings come every few ticks, late by some milliseconds, on a clock that differs by less than the tolerance."""
    rng = np.random.default_rng(seed)
    sensing, taken = sensing_of(), 0.0
    for k in range(60):
        if k % period == 0:
            taken = max(taken, DT * k - rng.uniform(0.0, 0.005))  # a newer reading is never an older one
        feed(sensing, ROBOT.home, np.full(K, 0.5), np.full(K, DT * k - taken + skew))
        assert (sensing.health.codes == HEALTHY).all()


@pytest.mark.parametrize(
    ("ages", "sick"),
    [
        ([0.0, -0.0101], True),
        ([0.0, -0.0099], False),
        ([0.0, 0.0141], True),  # older by 14.1 ms after 4 ms
        ([0.0, 0.0139], False),
        ([0.03, 0.0], False),  # a newer reading
        ([np.nan, 0.03], False),
        ([np.inf, 0.0], False),
        ([0.0, -np.inf], True),
        ([0.03], False),  # the first one may be of any age
    ],
)
def test_ages_are_impossible_beyond_the_tolerance(ages: list[float], sick: bool) -> None:
    sensing = sensing_of()
    for age in ages:
        feed(sensing, ROBOT.home, np.full(K, 0.5), np.full(K, age))
    assert (sensing.health.codes == (IMPOSSIBLE_AGE if sick else HEALTHY)).all()


@settings(max_examples=some(8, of=40), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_whatever_is_beyond_the_range_is_nothing_in_sight(seed: int) -> None:
    """Constant or not, while the robot moves in any way: the same as +inf, at every tick and for every spot."""
    assert SPOTS is not None
    rng = np.random.default_rng(seed)
    one, other = sensing_of(), sensing_of()
    beyond = SPOTS.range_max * (1.0 + rng.exponential(1.0, K)) + 1e-9
    near = rng.uniform(0.2, 0.7, K)
    q, speed = rng.uniform(ROBOT.lower, ROBOT.upper), rng.normal(size=ROBOT.nq)
    for k in range(60):
        hidden = rng.random(K) < (0.95 if k > 20 else 0.5)
        beyond = np.where(rng.random(K) < 0.02, beyond + 0.1, beyond)
        state = q + 0.02 * k * speed
        a = feed(one, state, np.where(hidden, beyond, near + 0.01 * np.sin(k)), np.zeros(K))
        b = feed(other, state, np.where(hidden, np.inf, near + 0.01 * np.sin(k)), np.zeros(K))
        assert (one.health.codes == HEALTHY).all()
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(a.links, b.links)
        assert a.severity == b.severity == "clear"


def test_a_reading_that_is_stuck_within_the_range_still_is() -> None:
    """The mend for readings beyond the range leaves the others alone."""
    sensing = sensing_of()
    for k in range(40):
        feed(sensing, ROBOT.home + 0.02 * k, np.full(K, 0.6), np.zeros(K))
    assert sensing.health.stopped
