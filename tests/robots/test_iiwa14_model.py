"""The LBR iiwa 14 has the published kinematics, limits and mass, and one joint more than a pose needs."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import qpsafe

ROBOT = qpsafe.load_robot("iiwa14")
MODEL = mujoco.MjModel.from_xml_path(str(ROBOT.model_path))

# As published: limits [deg], speeds [deg/s], torques [N m]; lengths base-shoulder-elbow-wrist-flange [m].
LIMITS = [(170, 85, 320), (120, 85, 320), (170, 100, 176), (120, 75, 176)]
LIMITS += [(170, 130, 110), (120, 135, 40), (175, 135, 40)]
LENGTHS = (0.360, 0.420, 0.400, 0.126)


def test_limits_are_the_published_ones() -> None:
    range_, speed, torque = np.array(LIMITS, dtype=float).T
    np.testing.assert_allclose(np.rad2deg(ROBOT.upper), range_, rtol=1e-14)
    np.testing.assert_allclose(np.rad2deg(ROBOT.lower), -range_, rtol=1e-14)
    np.testing.assert_allclose(np.rad2deg(ROBOT.max_velocity), speed, rtol=1e-14)
    np.testing.assert_array_equal(MODEL.actuator_ctrlrange[:, 1], torque)


def test_straight_up_it_is_as_tall_as_its_lengths() -> None:
    pose = ROBOT.pose("flange", np.zeros(7))
    np.testing.assert_allclose(pose[:3, 3], [0, 0, sum(LENGTHS)], rtol=0, atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3], np.eye(3), rtol=0, atol=1e-12)


def test_signs_of_the_joints() -> None:
    """Positive joints 2 and 6 lean the arm forwards, joint 4 backwards, as on the maker's controller."""
    for joint, sign in ((1, 1.0), (3, -1.0), (5, 1.0)):
        q = np.zeros(7)
        q[joint] = 0.1
        assert sign * ROBOT.pose("flange", q)[0, 3] > 0.0
    for joint in (0, 2, 4, 6):
        q = np.zeros(7)
        q[joint] = 0.1
        np.testing.assert_allclose(ROBOT.pose("flange", q)[:2, 0], [np.cos(0.1), np.sin(0.1)], rtol=0, atol=1e-12)


def test_mass_is_the_published_one_and_the_tool_comes_on_top() -> None:
    assert MODEL.body_mass.sum() == pytest.approx(29.9 + ROBOT.tool.mass)


def test_the_elbow_swings_while_the_tool_stays() -> None:
    """One direction of joint motion leaves the tool's pose: shoulder, wrist stay, the elbow moves."""
    state = ROBOT.at(ROBOT.home)
    _, values, rows = np.linalg.svd(state.jacobian("tcp"))
    assert len(values) == 6
    free = rows[6]
    np.testing.assert_allclose(state.jacobian("tcp") @ free, 0.0, atol=1e-14)
    assert np.linalg.norm(state.jacobian("dh3")[:3] @ free) > 0.05
    np.testing.assert_allclose(state.jacobian("dh5")[:3] @ free, 0.0, atol=1e-14)


def test_moving_one_joint_over_its_whole_range_touches_nothing() -> None:
    data = mujoco.MjData(MODEL)
    for joint in range(7):
        for value in np.linspace(ROBOT.lower[joint], ROBOT.upper[joint], 13):
            data.qpos[:] = 0.0
            data.qpos[joint] = value
            mujoco.mj_forward(MODEL, data)
            assert data.ncon == 0, f"joint_{joint + 1} at {np.rad2deg(value):.0f} deg"
