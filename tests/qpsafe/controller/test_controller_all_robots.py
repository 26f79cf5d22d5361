"""Singular poses, contradictory limits and starts outside them, on every bundled robot: never raised, never unsafe."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import crossed, thinned

import qpsafe
from qpsafe.danger.thresholds import robot_activation
from qpsafe.limits import JointLimits
from qpsafe.robot.loader import bundled_robots

ROBOTS = {name: qpsafe.load_robot(name) for name in bundled_robots()}
LAWS = {
    "strict": qpsafe.HierarchicalLaw,
    "paper": lambda: qpsafe.HierarchicalLaw("paper"),
    "nullspace": qpsafe.NullspaceLaw,
    "weighted": qpsafe.WeightedLaw,
}
each_robot = pytest.mark.parametrize("name", ROBOTS)
each_pair = pytest.mark.parametrize(("name", "law"), thinned(2, crossed(ROBOTS, LAWS)))


def controller(robot: Any, law: str, goal_q: np.ndarray, **options: Any) -> Any:
    goals = {frame: qpsafe.FixedPose(robot.pose(frame, goal_q)) for frame in robot.tool_frames}
    tasks: list[Any] = [qpsafe.PositionTask(frame, goal) for frame, goal in goals.items()]
    tasks += [qpsafe.OrientationTask(frame, goal) for frame, goal in goals.items()]
    activation = robot_activation(robot, len(goals), len(goals))
    return qpsafe.SafetyController(robot, tasks, LAWS[law](), activation=activation, **options)


def singular_poses(robot: Any) -> list[np.ndarray]:
    """Zero (stretched out: every bundled arm is singular there), and home with every other joint at a limit."""
    poses = [np.clip(np.zeros(robot.nq), robot.lower, robot.upper)]
    for joint in range(1, robot.nq, 2):
        pose = robot.home.copy()
        pose[joint] = robot.upper[joint]
        poses.append(pose)
    return poses


def run(robot: Any, control: Any, q: np.ndarray, ticks: int, points: Any = None) -> tuple[np.ndarray, list[Any]]:
    """Feed commands back as measurements; every command is checked."""
    qd, seen = np.zeros(robot.nq), []
    for _ in range(ticks):
        tick = control.step(q, qd, points=[] if points is None else points)
        assert tick.status in ("ok", "degraded"), tick.messages
        assert np.isfinite(tick.reference.q).all()
        assert np.isfinite(tick.reference.qd).all()
        assert (np.abs(tick.reference.qd) <= robot.max_velocity + 1e-9).all()
        assert (np.abs(tick.reference.qd - qd) <= robot.max_acceleration * control.dt + 1e-9).all()
        q, qd = tick.reference.q, tick.reference.qd
        seen.append(tick)
    return q, seen


@each_pair
def test_singular_poses_never_raise_and_never_pass_a_limit(name: str, law: str) -> None:
    robot = ROBOTS[name]
    for start in singular_poses(robot):
        tip = robot.pose(robot.tool_frames[0], start)[:3, 3]
        for points in (None, [tip + np.array([0.2, 0.05, 0.1])]):
            run(robot, controller(robot, law, robot.home), start, 12, points)


def test_the_zero_pose_is_singular_indeed() -> None:
    for robot in ROBOTS.values():
        zero = np.clip(np.zeros(robot.nq), robot.lower, robot.upper)
        worst = [np.linalg.svd(robot.jacobian(f, zero), compute_uv=False)[5] for f in robot.tool_frames]
        assert min(worst) < 0.02, robot.name


@each_pair
def test_a_start_outside_a_limit_comes_back_at_bounded_speed(name: str, law: str) -> None:
    robot = ROBOTS[name]
    for joint in range(0, robot.nq, 3):
        start = robot.home.copy()
        start[joint] = robot.upper[joint] + 0.05
        q, _ = run(robot, controller(robot, law, robot.home), start, 170)
        assert (q <= robot.upper + 1e-9).all(), robot.joint_names[joint]
        assert (q >= robot.lower - 1e-9).all()


@each_robot
def test_limits_that_contradict_each_other_never_raise(name: str) -> None:
    """No room at all for a joint, and a start beyond it: some limit has to give way, and the tick says which."""
    robot = ROBOTS[name]
    lower, upper = robot.lower.copy(), robot.upper.copy()
    lower[1], upper[1] = robot.home[1] + 0.10, robot.home[1] + 0.1001  # the arm is not there, and hardly fits
    limits = JointLimits(lower, upper, robot.max_velocity, robot.max_acceleration * 0.05, 0.004)
    control = controller(robot, "strict", robot.home, limits=limits)
    q, qd = robot.home.copy(), 0.9 * robot.max_velocity
    tip = robot.pose(robot.tool_frames[0], q)[:3, 3]
    for k in range(60):
        tick = control.step(q, qd, points=[tip + np.array([0.1, 0.0, 0.05 * (k % 3)])])
        assert tick.status in ("ok", "degraded"), tick.messages
        assert np.isfinite(tick.reference.qd).all()
        assert (np.abs(tick.reference.qd) <= robot.max_velocity + 1e-9).all()
        q, qd = tick.reference.q, tick.reference.qd
