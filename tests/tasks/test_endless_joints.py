"""Joints that turn without end take the short way; those with limits, and those that slide, go the way there is."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from amounts import first
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.robot.models.mjcf import ENDLESS
from qpsafe.robot.robot import Robot
from qpsafe.tasks.program_file import load_program
from qpsafe.tasks.trajectory import FixedJoints, JointSample

TURN = 2.0 * np.pi
URDF = """<robot name="mixed"><link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="tip"/>
  <joint name="rail" type="prismatic"><parent link="base"/><child link="a"/><axis xyz="1 0 0"/>
    <limit lower="-2" upper="9" velocity="1" effort="1"/></joint>
  <joint name="turn" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
    <limit velocity="2" effort="1"/></joint>
  <joint name="bend" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-7" upper="7" velocity="2" effort="1"/></joint>
  <joint name="end" type="fixed"><parent link="c"/><child link="tip"/><origin xyz="0.3 0 0"/></joint></robot>"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path: Path = tmp_path_factory.mktemp("mixed") / "mixed.urdf"
    path.write_text(URDF)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return qpsafe.load_robot(path)


angles = st.lists(st.floats(-6.5, 6.5), min_size=3, max_size=3).map(np.array)


def test_what_turns_without_end(robot: Robot) -> None:
    np.testing.assert_array_equal(robot.endless, [False, True, False])
    np.testing.assert_array_equal(robot.sliding, [True, False, False])
    assert robot.upper[1] == -robot.lower[1] == ENDLESS
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        bounded = qpsafe.load_robot(robot.model_path, lower=-6.0, upper=6.0)
    assert not bounded.endless.any()


@given(q=angles, goal=angles, turns=st.integers(-5, 5))
def test_the_error_is_the_short_way(robot: Robot, q: np.ndarray, goal: np.ndarray, turns: int) -> None:
    goal = goal + turns * TURN * np.array([0.0, 1.0, 0.0])
    task, sample = qpsafe.JointTask(FixedJoints(goal)), JointSample(goal, np.zeros(3))
    error = task.error(task.value(robot.at(q)), sample)
    np.testing.assert_array_equal(error[[0, 2]], (goal - q)[[0, 2]])
    assert abs(error[1]) <= np.pi + 1e-9
    assert abs(np.sin(0.5 * (q[1] + error[1] - goal[1]))) <= 1e-9  # the same place, whole turns aside
    near = robot.nearest(goal, q)
    np.testing.assert_allclose(near, q + error, rtol=0, atol=1e-12)
    np.testing.assert_allclose(robot.pose("tip", near), robot.pose("tip", goal), rtol=0, atol=1e-9)
    np.testing.assert_allclose(task.offset(task.value(robot.at(q)), sample), -error, rtol=0, atol=0)


def run(robot: Robot, q: np.ndarray, *tasks: qpsafe.JointTask, seconds: float = 6.0) -> np.ndarray:
    """A robot that follows: the joint positions of every tick."""
    controller = qpsafe.SafetyController(robot, list(tasks))
    way, qd = [q], np.zeros(3)
    for _ in range(round(seconds / controller.dt)):
        tick = controller.step(way[-1], qd, points=np.empty((0, 3)))
        assert tick.status == "ok"
        way.append(tick.reference.q)
        qd = tick.reference.qd
    return np.array(way)


@pytest.mark.parametrize(
    ("start", "goal", "way"), first(2, [(350.0, 10.0, 20.0), (170.0, -170.0, 20.0), (-350.0, 20.0, 10.0)])
)
def test_a_joint_task_goes_there(robot: Robot, start: float, goal: float, way: float) -> None:
    q, there = np.array([0.1, np.deg2rad(start), 0.2]), np.array([0.4, np.deg2rad(goal), -0.3])
    turned = np.rad2deg(run(robot, q, qpsafe.JointTask(FixedJoints(there)))[:, 1])
    assert np.abs(np.diff(turned)).sum() == pytest.approx(way, abs=0.1)
    assert abs((turned[-1] - goal + 180.0) % 360.0 - 180.0) < 0.01


def test_a_pose_beyond_a_whole_turn_is_reached(robot: Robot) -> None:
    q, there = np.array([0.0, np.deg2rad(350.0), 0.2]), np.array([0.0, np.deg2rad(10.0), 0.2])
    way = run(robot, q, qpsafe.PositionTask("tip", qpsafe.FixedPose(robot.pose("tip", there))), seconds=12.0)
    np.testing.assert_allclose(robot.pose("tip", way[-1])[:3, 3], robot.pose("tip", there)[:3, 3], atol=1e-5)
    assert np.abs(np.diff(way[:, 1])).sum() < np.deg2rad(60.0)


def test_a_way_back_is_the_short_one(robot: Robot) -> None:
    """Suspended by a danger, then released: the offset that the recovery remembers is the short one too."""
    q, there = np.array([0.0, np.deg2rad(350.0), 0.2]), np.array([0.0, np.deg2rad(10.0), 0.2])
    controller = qpsafe.SafetyController(robot, [qpsafe.JointTask(FixedJoints(there))])
    way, qd = [q], np.zeros(3)
    close = robot.pose("tip", q)[:3, 3] + [0.0, 0.0, 0.6]
    for k in range(3000):
        tick = controller.step(way[-1], qd, points=close[None] if k < 50 else np.empty((0, 3)))
        way.append(tick.reference.q)
        qd = tick.reference.qd
    turned = np.rad2deg(np.array(way)[:, 1])
    assert turned.min() > 180.0
    assert abs((turned[-1] - 10.0 + 180.0) % 360.0 - 180.0) < 0.1


def test_a_program_turns_the_short_way_and_slides_in_metres(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "turn.toml"
    path.write_text(
        'frame = "tip"\nstart = "a"\n[points]\na = { joints = [0.1, 350.0, 10.0] }\n'
        'b = { joints = [0.4, 10.0, 10.0] }\n[[segment]]\ndo = "joint"\nto = "b"\n'
    )
    program = load_program(path, robot)
    first = robot.pose("tip", [0.1, np.deg2rad(350.0), np.deg2rad(10.0)])
    np.testing.assert_allclose(program.sample(0.0).pose, first, atol=1e-12)
    middle = program.sample(0.5 * program.duration).pose[:3, 3]
    np.testing.assert_allclose(middle, robot.pose("tip", [0.25, 0.0, np.deg2rad(10.0)])[:3, 3], atol=1e-6)
