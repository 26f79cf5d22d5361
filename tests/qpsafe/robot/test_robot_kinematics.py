"""`Robot` and `RobotState`: derivatives agree with differences, states do not disturb each other."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot

ROBOT = load_robot("irb140")
STEP = 1e-6
unit = hnp.arrays(float, 6, elements=st.floats(0.0, 1.0))
speeds = hnp.arrays(float, 6, elements=st.floats(-4.0, 4.0))
quick = settings(max_examples=some(8, of=40), deadline=None)


def inside(fraction: np.ndarray) -> np.ndarray:
    return ROBOT.lower + fraction * (ROBOT.upper - ROBOT.lower)


@quick
@given(unit, st.sampled_from(ROBOT.frame_names))
def test_jacobian_is_the_derivative_of_the_pose(fraction: np.ndarray, frame: str) -> None:
    q = inside(fraction)
    state = ROBOT.at(q)
    jacobian = state.jacobian(frame)
    assert jacobian.shape == (6, 6)
    for j in range(6):
        step = STEP * np.eye(6)[j]
        before, after = ROBOT.pose(frame, q - step), ROBOT.pose(frame, q + step)
        linear = (after[:3, 3] - before[:3, 3]) / (2 * STEP)
        spin = (after[:3, :3] - before[:3, :3]) @ state.rotation(frame).T / (2 * STEP)  # dR/dt R^T = [omega x]
        angular = 0.5 * np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]])
        np.testing.assert_allclose(jacobian[:, j], np.r_[linear, angular], rtol=0, atol=1e-8)


@quick
@given(unit, speeds)
def test_wire_velocities_are_the_derivatives_of_the_ends(fraction: np.ndarray, qd: np.ndarray) -> None:
    q = inside(fraction)
    wire = ROBOT.wire(q, qd)
    before, after = ROBOT.wire(q - STEP * qd, qd), ROBOT.wire(q + STEP * qd, qd)
    np.testing.assert_allclose(wire.start_velocities, (after.starts - before.starts) / (2 * STEP), rtol=0, atol=1e-7)
    np.testing.assert_allclose(wire.end_velocities, (after.ends - before.ends) / (2 * STEP), rtol=0, atol=1e-7)


@quick
@given(unit, speeds)
def test_wire_runs_between_its_frames_as_rigid_links(fraction: np.ndarray, qd: np.ndarray) -> None:
    state = ROBOT.at(inside(fraction))
    wire = state.wire(qd)
    assert all(part.shape == (6, 3) for part in wire)
    for row, (start, end) in enumerate(ROBOT.wire_frames):
        np.testing.assert_allclose(wire.starts[row], state.position(start), rtol=0, atol=1e-14)
        np.testing.assert_allclose(wire.ends[row], state.position(end), rtol=0, atol=1e-14)
        np.testing.assert_allclose(wire.end_velocities[row], state.jacobian(end)[:3] @ qd, rtol=0, atol=1e-12)
    stretch = (wire.end_velocities - wire.start_velocities) * (wire.ends - wire.starts)
    np.testing.assert_allclose(stretch.sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_array_equal(wire.start_velocities[0], 0.0)  # frame 0 does not move


def test_two_links_of_the_wire_have_no_length() -> None:
    wire = ROBOT.wire(ROBOT.home, np.zeros(6))
    lengths = np.linalg.norm(wire.ends - wire.starts, axis=1)
    tip = np.hypot(0.065 + 0.14, 0.0)
    np.testing.assert_allclose(lengths, [np.hypot(0.07, 0.352), 0.36, 0.0, 0.38, 0.0, tip], rtol=0, atol=1e-12)


@quick
@given(unit)
def test_wire_jacobians_are_the_frames_linear_rows(fraction: np.ndarray) -> None:
    state = ROBOT.at(inside(fraction))
    jacobians = state.wire_jacobians()
    for row, frame in enumerate(ROBOT.wire_end_frames):
        np.testing.assert_allclose(jacobians[row], state.jacobian(frame)[:3], rtol=0, atol=1e-14)
    np.testing.assert_array_equal(jacobians[ROBOT.wire_end_frames.index("dh0")], 0.0)


def test_states_alive_together_do_not_disturb_each_other() -> None:
    rng = np.random.default_rng(3)
    configurations = rng.uniform(ROBOT.lower, ROBOT.upper, (20, 6))
    alone = [ROBOT.pose("tcp", q) for q in configurations]
    states = [ROBOT.at(q) for q in configurations]
    kept = [(state.pose("tcp"), state.jacobian("tcp"), state.wire(np.ones(6))) for state in states]
    for state, expected in zip(states, alone, strict=True):
        np.testing.assert_array_equal(state.pose("tcp"), expected)
    del states, state  # the work spaces go back and are used again: what was returned must not change
    copies = [(pose.copy(), jacobian.copy(), wire.ends.copy()) for pose, jacobian, wire in kept]
    for q in configurations[::-1]:
        ROBOT.wire(q, q)
        ROBOT.jacobian("tcp", q)
    for (pose, jacobian, wire), (pose_copy, jacobian_copy, ends_copy) in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(pose, pose_copy)
        np.testing.assert_array_equal(jacobian, jacobian_copy)
        np.testing.assert_array_equal(wire.ends, ends_copy)


def test_a_caller_who_overwrites_results_or_q_harms_nobody() -> None:
    q = ROBOT.home.copy()
    state = ROBOT.at(q)
    expected = state.pose("tcp"), state.jacobian("tcp"), state.wire(np.ones(6)).ends
    q[:] = 9.0
    for array in (state.pose("tcp"), state.position("tcp"), state.rotation("tcp"), state.jacobian("tcp")):
        array[:] = 9.0
    state.wire(np.ones(6)).ends[:] = 9.0
    np.testing.assert_array_equal(state.q, ROBOT.home)
    np.testing.assert_array_equal(state.pose("tcp"), expected[0])
    np.testing.assert_array_equal(state.jacobian("tcp"), expected[1])
    np.testing.assert_array_equal(state.wire(np.ones(6)).ends, expected[2])
    with pytest.raises(ValueError, match="read-only"):
        state.wire_jacobians()[:] = 9.0


@pytest.mark.parametrize("name", ["lower", "upper", "max_velocity", "max_acceleration", "home"])
def test_limits_are_read_only_arrays(name: str) -> None:
    array = getattr(ROBOT, name)
    assert array.shape == (ROBOT.nq,)
    assert array.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1.0


@pytest.mark.parametrize("frame", ["dh7", "", None, 3, ["tcp"]])
def test_an_unknown_frame_is_an_error_that_lists_the_frames(frame: object) -> None:
    for ask in (ROBOT.pose, ROBOT.jacobian):
        with pytest.raises(ConfigurationError) as caught:
            ask(frame, ROBOT.home)
        assert all(name in str(caught.value) for name in ROBOT.frame_names)


@pytest.mark.parametrize("q", [np.zeros(5), np.zeros(7), np.zeros((6, 1)), 0.0, "home", None])
def test_a_configuration_of_the_wrong_shape_is_an_error(q: object) -> None:
    with pytest.raises(ConfigurationError, match="6 numbers"):
        ROBOT.at(q)
    with pytest.raises(ConfigurationError, match="6 numbers"):
        ROBOT.at(ROBOT.home).wire(q)


def test_values_that_are_no_numbers_do_not_raise_and_do_not_linger() -> None:
    bad = ROBOT.home.copy()
    bad[2] = np.nan
    assert np.isnan(ROBOT.pose("tcp", bad)).any()
    expected = load_robot("irb140").pose("tcp", ROBOT.home)
    np.testing.assert_array_equal(ROBOT.pose("tcp", ROBOT.home), expected)
