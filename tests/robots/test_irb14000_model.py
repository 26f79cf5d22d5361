"""The IRB 14000: two arms with the published kinematics on one torso, each with joints, tool and wire of its own."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import qpsafe

ROBOT = qpsafe.load_robot("irb14000")
MODEL = mujoco.MjModel.from_xml_path(str(ROBOT.model_path))
MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])

# As published, along an arm: joint, limits [deg], speed [deg/s].
LIMITS = {1: (-168.5, 168.5, 180), 2: (-143.5, 43.5, 180), 7: (-168.5, 168.5, 180), 3: (-123.5, 80, 180)}
LIMITS |= {4: (-290, 290, 400), 5: (-88, 138, 400), 6: (-229, 229, 400)}


def test_two_arms_of_seven_joints_with_the_published_limits() -> None:
    names = [f"{arm}_joint_{joint}" for arm in ("left", "right") for joint in LIMITS]
    assert list(ROBOT.joint_names) == names
    lower, upper, speed = np.deg2rad(list(LIMITS.values()) * 2).T
    np.testing.assert_allclose(ROBOT.lower, lower, rtol=1e-14)
    np.testing.assert_allclose(ROBOT.upper, upper, rtol=1e-14)
    np.testing.assert_allclose(ROBOT.max_velocity, speed, rtol=1e-14)


def test_lengths_of_upper_arm_and_forearm_are_the_published_ones() -> None:
    for arm in ("left", "right"):
        for q in np.random.default_rng(2).uniform(ROBOT.lower, ROBOT.upper, (5, 14)):
            state = ROBOT.at(q)
            places = [state.position(f"{arm}_dh{i}") for i in range(8)]
            lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
            upper_arm, forearm = np.hypot(0.2515, 0.0405), np.hypot(0.265, 0.027)
            np.testing.assert_allclose(lengths[[2, 4, 6]], [upper_arm, forearm, 0.036], rtol=0, atol=1e-12)


def test_the_arms_are_mirror_images_in_mirrored_poses() -> None:
    """Both arms are the same arm; with joints 1, 7, 4, 6 turned the other way the tools mirror each other's places."""
    flip = np.diag([1.0, -1.0, 1.0])
    for q in np.random.default_rng(3).uniform(ROBOT.lower[:7] * 0.5, ROBOT.upper[:7] * 0.5, (10, 7)):
        state = ROBOT.at(np.concatenate([q, MIRROR * q]))
        left, right = state.pose("left_tcp"), state.pose("right_tcp")
        np.testing.assert_allclose(right[:3, 3], flip @ left[:3, 3], rtol=0, atol=1e-9)
        np.testing.assert_allclose(right[:3, :3], flip @ left[:3, :3] @ flip, rtol=0, atol=1e-9)


def test_home_is_symmetric_with_both_tools_down() -> None:
    np.testing.assert_allclose(ROBOT.home[7:], MIRROR * ROBOT.home[:7], atol=1e-15)
    for frame in ROBOT.tool_frames:
        assert ROBOT.pose(frame, ROBOT.home)[2, 2] < -0.999


def test_neither_arm_moves_the_other() -> None:
    state = ROBOT.at(ROBOT.home)
    assert not state.jacobian("left_tcp")[:, 7:].any()
    assert not state.jacobian("right_tcp")[:, :7].any()
    wire = ROBOT.wire(ROBOT.home, np.concatenate([np.full(7, 0.3), np.zeros(7)]))
    assert len(wire.starts) == 14
    assert np.abs(wire.end_velocities[:7]).max() > 0.05
    assert not wire.end_velocities[7:].any()


def test_mass_is_the_published_one_and_the_tools_come_on_top() -> None:
    assert MODEL.body_mass.sum() == pytest.approx(38.0 + sum(tool.mass for tool in ROBOT.tools))


def test_evasion_pushes_only_the_arm_that_is_near() -> None:
    """A point beside the left elbow: the left arm moves away; both arms' tasks are levels of one hierarchy."""
    from qpsafe.danger.thresholds import robot_activation

    goals = {frame: qpsafe.FixedPose(ROBOT.pose(frame, ROBOT.home)) for frame in ROBOT.tool_frames}
    tasks = [qpsafe.PositionTask(frame, goal) for frame, goal in goals.items()]
    tasks += [qpsafe.OrientationTask(frame, goal) for frame, goal in goals.items()]
    controller = qpsafe.SafetyController(ROBOT, tasks, activation=robot_activation(ROBOT, 2, 2))
    q, qd = ROBOT.home.copy(), np.zeros(14)
    elbow = ROBOT.pose("left_dh4", q)[:3, 3]
    point = elbow + np.array([0.0, 0.16, 0.0])
    for _ in range(150):
        tick = controller.step(q, qd, points=[point])
        assert tick.status == "ok"
        q, qd = tick.reference.q, tick.reference.qd
    moved = np.abs(q - ROBOT.home)
    assert moved[:7].max() > 0.02
    assert np.linalg.norm(ROBOT.pose("left_dh4", q)[:3, 3] - point) > 0.165
    assert moved[7:].max() < 0.2 * moved[:7].max()


def test_a_task_of_one_arm_never_moves_the_other() -> None:
    goal = ROBOT.pose("left_tcp", ROBOT.home)
    goal[:3, 3] += [0.0, 0.03, 0.02]
    controller = qpsafe.SafetyController(ROBOT, [qpsafe.PositionTask("left_tcp", qpsafe.FixedPose(goal), gain=4.0)])
    q, qd = ROBOT.home.copy(), np.zeros(14)
    for _ in range(700):
        tick = controller.step(q, qd, points=[])
        q, qd = tick.reference.q, tick.reference.qd
    assert np.linalg.norm(ROBOT.pose("left_tcp", q)[:3, 3] - goal[:3, 3]) < 1e-3
    np.testing.assert_allclose(q[7:], ROBOT.home[7:], rtol=0, atol=1e-9)
