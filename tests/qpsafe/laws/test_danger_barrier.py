"""The cap on the danger field: gradients by finite differences, scaling exact, the soft level does what it says."""

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.laws.barrier import DangerBarrier

ROBOT = qpsafe.load_robot("irb140")
FIELD = qpsafe.DangerField()
seeds = st.integers(0, 10_000)


def scene(seed: int) -> tuple:
    rng = np.random.default_rng(seed)
    q = ROBOT.home + 0.5 * rng.normal(size=6)
    points = rng.uniform(-0.8, 0.8, (4, 3)) + np.array([0.4, 0.0, 0.6])
    return ROBOT.at(q), rng.normal(size=6), points


@settings(max_examples=some(10, of=25), deadline=None)
@given(seeds)
def test_static_gradient_is_the_derivative_of_the_field(seed: int) -> None:
    state, _, points = scene(seed)
    gradient, h = DangerBarrier(10.0).static_gradient(state, points), 1e-6
    for j in range(6):
        step = h * np.eye(6)[j]
        values = [FIELD.value(points, ROBOT.wire(state.q + s * step, np.zeros(6))) for s in (1.0, -1.0)]
        difference = (values[0] - values[1]) / (2 * h)
        assert gradient[:, j] == pytest.approx(difference, rel=1e-5, abs=1e-5 * np.abs(gradient).max())


@settings(max_examples=some(10, of=25), deadline=None)
@given(seeds)
def test_kinetic_gradient_obeys_eulers_theorem(seed: int) -> None:
    """H is homogeneous of degree 1: ∂H/∂q̇ q̇ = H."""
    state, qd, points = scene(seed)
    H = FIELD.value(points, state.wire(qd)) - FIELD.value(points, state.wire(np.zeros(6)))
    assert DangerBarrier(10.0).kinetic_gradient(state, qd, points) @ qd == pytest.approx(H, rel=1e-12)


@settings(max_examples=some(10, of=25), deadline=None)
@given(seeds, st.floats(0.0, 0.99e-3))
def test_at_rest_no_direction_of_motion_counts(seed: int, speed: float) -> None:
    """H has a kink at rest: a direction that rounding has chosen must not decide where the robot goes."""
    state, qd, points = scene(seed)
    assert not DangerBarrier(10.0).kinetic_gradient(state, speed * qd / np.abs(qd).max(), points).any()


@settings(max_examples=some(8, of=40), deadline=None)
@given(seeds, st.floats(3.0, 30.0), st.floats(0.1, 5.0))
def test_scaling_caps_the_field_exactly(seed: int, delta_max: float, speed: float) -> None:
    state, qd, points = scene(seed)
    qd = speed * qd
    barrier = DangerBarrier(delta_max)
    factor, unreachable = barrier.scale(state, qd, points)
    static = FIELD.value(points, state.wire(np.zeros(6)))
    capped = FIELD.value(points, state.wire(factor * qd))
    assert 0.0 <= factor <= 1.0
    assert unreachable == (static >= delta_max).sum()
    room = static < delta_max
    assert (capped[room] <= delta_max * (1 + 1e-9)).all()
    if factor < 1.0:  # no slower than it must be
        assert capped[room].max() == pytest.approx(delta_max, rel=1e-9)


@settings(max_examples=some(10, of=25), deadline=None)
@given(seeds)
def test_soft_level_predicts_the_field_along_the_present_motion(seed: int) -> None:
    """With τ = 0 and q̇ the present velocity, a row's value is CDF itself."""
    state, qd, points = scene(seed)
    danger = FIELD.value(points, state.wire(qd))
    level = DangerBarrier(11.0, horizon=0.0, points=4).level(state, qd, points, danger)
    order = np.argsort(-danger, kind="stable")
    assert level.A @ qd + (11.0 - level.upper) == pytest.approx(danger[order], rel=1e-5)


def test_no_points_no_level_no_scaling() -> None:
    state, qd, _ = scene(0)
    barrier = DangerBarrier(10.0)
    assert barrier.level(state, qd, np.zeros((0, 3)), np.zeros(0)) is None
    assert barrier.scale(state, qd, np.zeros((0, 3))) == (1.0, 0)


@pytest.mark.parametrize("bad", [{"delta_max": 0.0}, {"delta_max": np.nan}, {"delta_max": 9.0, "horizon": -1.0}])
def test_wrong_settings_are_refused(bad: dict) -> None:
    with pytest.raises(ConfigurationError, match="DangerBarrier"):
        DangerBarrier(**bad)
