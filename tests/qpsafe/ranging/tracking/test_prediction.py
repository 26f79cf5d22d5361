"""A known velocity adds danger and never takes any away: never less careful than without it."""

from typing import Any

import numba
import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.ranging.tracking import prediction
from qpsafe.ranging.tracking.prediction import Foresight

number = st.floats(-1.0, 1.0)
poses = st.lists(st.floats(-1.2, 1.2), min_size=6, max_size=6).map(np.array)
seeds = st.integers(0, 2**32 - 1)
FIELD = qpsafe.DangerField(gamma=1.0)
WEIGHTS = (FIELD.static, FIELD.kinetic, FIELD.gamma)
D_MIN = 0.16


def distances(points: np.ndarray, wire: Any) -> np.ndarray:
    """To the wire, by samples of it."""
    s = np.linspace(0.0, 1.0, 2001)[:, None]
    samples = np.concatenate([a + s * (b - a) for a, b in zip(wire[0], wire[1], strict=True)])
    return np.array([np.linalg.norm(samples - p, axis=1).min() for p in points])


@settings(max_examples=some(8, of=40), deadline=None)
@given(poses, poses, seeds, st.floats(0.0, 0.3))
def test_danger_is_never_less(irb140: Any, q: np.ndarray, qd: np.ndarray, seed: int, elapsed: float) -> None:
    """The robot may come, go, or stand: the point counts at least as much as it does at rest, where it was seen."""
    rng = np.random.default_rng(seed)
    points, velocities = rng.uniform(-1.0, 1.5, (12, 3)), rng.normal(size=(12, 3))
    velocities[:4] = 0.0
    wire = irb140.wire(q, 2.0 * qd)
    ages = np.full(12, elapsed)
    places, moving = Foresight(12)(points, velocities, ages, D_MIN, wire, WEIGHTS, FIELD.floor)
    known, unknown = FIELD.value(places, wire, moving), FIELD.value(points, wire)
    assert (known >= unknown * (1.0 - 1e-12)).all()
    assert np.array_equal(places[:4], points[:4])
    assert not moving[:4].any()
    # and it is one of the three that it says, nowhere nearer than d_min by itself
    ahead = np.linalg.norm(places - points, axis=1)
    assert (ahead <= np.linalg.norm(velocities, axis=1) * elapsed + 1e-12).all()
    gone = ahead > 0.0
    assert (distances(places[gone], wire) >= D_MIN - 1e-3).all()
    assert (np.linalg.norm(moving, axis=1) <= np.linalg.norm(velocities, axis=1) + 1e-12).all()


@settings(max_examples=some(8, of=20), deadline=None)
@given(poses, seeds)
def test_what_comes_nearer_to_a_robot_at_rest_is_more_danger(irb140: Any, q: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    wire = irb140.wire(q, np.zeros(6))
    points = rng.uniform(-1.0, 1.5, (20, 3))
    points = points[distances(points, wire) > D_MIN]
    velocities = 0.5 * (np.array([0.0, 0.0, 0.4]) - points)
    places, moving = Foresight(20)(points, velocities, np.full(len(points), 0.1), D_MIN, wire, WEIGHTS, FIELD.floor)
    coming = np.linalg.norm(moving, axis=1) > 1e-3
    known, unknown = FIELD.value(places, wire, moving), FIELD.value(points, wire)
    assert (known[coming] > unknown[coming]).all()
    away = Foresight(20)(points, np.zeros((len(points), 3)), np.full(len(points), 0.1), D_MIN, wire, WEIGHTS, 1e-3)
    assert np.array_equal(away[0], points)


@pytest.fixture(scope="module")
def person_speed() -> Any:
    inner = prediction.person_speed
    return numba.njit(lambda x, v_h, a, t, most: inner((x, 0.0, 0.0), v_h, a, t, most))


@settings(max_examples=some(16, of=100), deadline=None)
@given(st.floats(-4.0, 4.0), st.floats(0.0, 2.0), st.floats(0.0, 10.0), st.floats(0.0, 1.0), st.floats(0.0, 3.0))
def test_a_ball_is_never_smaller(
    person_speed: Any, speed: float, usual: float, acceleration: float, time: float, most: float
) -> None:
    grows = person_speed(speed, usual, acceleration, time, most)
    assert grows >= usual
    if abs(speed) > 1e-100:  # its square is a number
        assert grows == max(usual, min(abs(speed) + acceleration * time, most))
    assert person_speed(0.0, usual, acceleration, time, most) == usual
    assert person_speed(np.nan, usual, acceleration, time, most) == usual
