"""The first half of a tick in one compiled call against the same step by step, over bad sequences: the same bits."""

import copy
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.evasion import Evasion
from qpsafe.danger.field import DangerField
from qpsafe.sense import QuickSense, sense
from qpsafe.sense_points import QuickPoints
from qpsafe.sensing.detection import BadInput
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing

FLOOR = Obstacle.box("floor", (6, 6, 0.5), (0, 0, -0.4))


def tried(call: Any) -> Any:
    try:
        return call()
    except BadInput as problem:
        return str(problem)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([0.0, 0.02, 0.3]), st.booleans())
def test_one_call_is_the_steps_one_after_the_other(
    irb140: Any, seed: int, velocities: bool, sick: float, aged: bool
) -> None:
    rng, spots = np.random.default_rng(seed), qpsafe.load_spots(irb140)
    rules = SensingRules(velocities=velocities, dead_after=0.02)
    sensing = DistanceSensing(irb140, spots, 0.004, rules, (FLOOR,))
    field, evasion = DangerField(*rng.uniform(0.0, 2.0, 2)), Evasion(4.0, 20.0, 6)
    quick = QuickSense(irb140, sensing, field, evasion)
    other_sensing, other_evasion = copy.deepcopy((sensing, evasion))
    q, distances = irb140.home + rng.normal(0.0, 0.3, 6), rng.uniform(0.1, 1.4, len(spots))
    for _ in range(25):
        qd = rng.normal(0.0, 0.5, 6)
        q, distances = q + 0.004 * qd, distances + rng.normal(0.0, 0.01, len(spots))
        readings = np.where(rng.random(len(spots)) < sick, rng.choice([np.nan, np.inf, -1.0, 0.0]), distances)
        ages = rng.uniform(0.0, 0.06, len(spots)) if aged else None
        one = tried(lambda: quick(q, qd, readings, ages))  # noqa: B023  called at once
        other = tried(
            lambda: sense(irb140, q, qd, readings, None, ages, other_sensing, field, other_evasion)  # noqa: B023
        )
        if isinstance(other, str):
            assert one == other
        else:
            assert (one.cdf_n, one.notes, one.capped) == (other.cdf_n, other.notes, other.capped)
            for key in ("points", "links", "vectors", "qd0"):
                assert np.array_equal(getattr(one, key), getattr(other, key)), key
        assert np.array_equal(evasion.velocity, other_evasion.velocity)
        assert np.array_equal(sensing.counted, other_sensing.counted)
        assert sensing.health.severity == other_sensing.health.severity


@pytest.mark.parametrize("what", ["q", "qd", "list", "short", "absurd"])
def test_what_is_no_measurement_touches_nothing_and_is_left_to_the_steps(irb140: Any, what: str) -> None:
    spots = qpsafe.load_spots(irb140)
    sensing, evasion = DistanceSensing(irb140, spots, 0.004), Evasion(4.0, 20.0, 6)
    quick = QuickSense(irb140, sensing, DangerField(), evasion)
    q, qd, distances = irb140.home.copy(), np.zeros(6), np.full(len(spots), 0.3)
    if what == "q":
        q[2] = np.nan
    if what == "qd":
        qd[5] = np.inf
    if what == "absurd":
        q[0] = 90.0
    before = copy.deepcopy(sensing.memory)
    given_q, given_distances = q.tolist() if what == "list" else q, distances[1:] if what == "short" else distances
    assert quick(given_q, qd, given_distances, None) is None
    assert not evasion.velocity.any()
    for now, then in zip(sensing.memory, before, strict=True):
        np.testing.assert_array_equal(now, then)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["", "NaN", "far", "strided", "read-only"]))
def test_given_points_in_one_call_too(irb140: Any, seed: int, what: str) -> None:
    """None where `sense` refuses them by name, and then nothing has been touched; else the same bits."""
    rng = np.random.default_rng(seed)
    field, evasion = DangerField(*rng.uniform(0.0, 2.0, 2)), Evasion(4.0, 20.0, 6)
    quick, other_evasion, q = QuickPoints(irb140, field, evasion), copy.deepcopy(evasion), irb140.home.copy()
    for tick in range(10):
        qd = rng.normal(0.0, 0.5, 6)
        q = q + 0.004 * qd
        points = rng.normal(0.0, 1.0, (rng.integers(0, 30), 3))
        if tick == 7 and len(points):
            points[-1, 2] = {"NaN": np.nan, "far": 1e308}.get(what, points[-1, 2])
        if what == "strided":
            points = np.asfortranarray(points)
        points.flags.writeable = what != "read-only"
        kept = points.copy()
        one = tried(lambda: quick(q, qd, points))  # noqa: B023  called at once
        other = tried(lambda: sense(irb140, q, qd, None, points, None, None, field, other_evasion))  # noqa: B023
        if one is None or isinstance(other, str):
            assert isinstance(other, str)
            assert one in (None, other)
        else:
            assert (one.cdf_n, one.notes, one.capped) == (other.cdf_n, other.notes, other.capped)
            for key in ("points", "links", "vectors", "qd0"):
                assert np.array_equal(getattr(one, key), getattr(other, key)), key
            assert not np.shares_memory(one.points, points)  # they go into the tick
        assert np.array_equal(evasion.velocity, other_evasion.velocity)
        assert np.array_equal(points, kept, equal_nan=True)


@pytest.mark.parametrize("what", ["q", "qd", "absurd", "list", "shape"])
def test_what_is_no_measurement_or_no_points_is_left_to_the_steps(irb140: Any, what: str) -> None:
    evasion, q, qd = Evasion(4.0, 20.0, 6), irb140.home.copy(), np.zeros(6)
    points: Any = np.ones((2, 3))
    q[2] = np.nan if what == "q" else 90.0 if what == "absurd" else q[2]
    qd[5] = np.inf if what == "qd" else 0.0
    points = points.tolist() if what == "list" else points[:, :2] if what == "shape" else points
    assert QuickPoints(irb140, DangerField(), evasion)(q, qd, points) is None
    assert not evasion.velocity.any()
