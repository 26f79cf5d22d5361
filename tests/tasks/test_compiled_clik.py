"""Compiled CLIK of the built-in tasks against their own methods, which use pinocchio's logarithm."""

import numpy as np
import pinocchio as pin
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.robot.loader import load_robot
from qpsafe.tasks.task import Task
from qpsafe.tasks.trajectory import Sample

ROBOT = load_robot("irb140")
GOAL = qpsafe.FixedPose(ROBOT.pose("tcp", ROBOT.home))
TASKS = [
    qpsafe.PositionTask("tcp", GOAL, 3.0),
    qpsafe.OrientationTask("flange", GOAL),
    qpsafe.OrientationTask("tcp", GOAL, form="euler"),
    qpsafe.FrameTask("dh3", GOAL),
    qpsafe.FrameTask("tcp", GOAL, 2.0, rows=(0, 2, 4)),
    qpsafe.RelativeFrameTask("tcp", "dh3", GOAL),
]
angles = st.sampled_from([0.0, 1e-9, 1e-5, 3.14, np.pi - 1e-6]) | st.floats(0.0, 3.14)


@pytest.mark.parametrize("task", TASKS, ids=lambda task: f"{task.name} of {task.frame}")
@settings(max_examples=some(8, of=40), deadline=None)
@given(st.integers(0, 2**32 - 1), angles)
def test_clik_is_what_the_methods_say(task: Task, seed: int, angle: float) -> None:
    rng = np.random.default_rng(seed)
    state = ROBOT.at(rng.uniform(ROBOT.lower, ROBOT.upper))
    axis = rng.normal(size=3)
    pose = task.value(state)
    pose[:3, :3] = pin.exp3(angle * axis / np.linalg.norm(axis)) @ pose[:3, :3]
    pose[:3, 3] += rng.normal(size=3)
    sample = Sample(pose, rng.normal(size=6))
    clik, expected = task.clik(state, sample), Task.clik(task, state, sample)
    # near half a turn pinocchio's logarithm loses digits, and the last ones decide the sign of the axis
    tolerance = 1e-11 if angle < 3.0 else 1e-7
    for one, other in zip(clik, expected, strict=True):
        assert one.shape == other.shape
        assert one == pytest.approx(other, abs=tolerance * max(task.gain, 1.0))
    if task.name == "orientation" and task.form != "euler":  # type: ignore[attr-defined]
        assert np.linalg.norm(clik.error) == pytest.approx(angle, abs=1e-8)


def test_samples_that_are_no_plain_arrays_are_taken_all_the_same() -> None:
    state = ROBOT.at(ROBOT.home)
    pose, twist = GOAL.pose.astype(np.float32), np.ones(6)
    for task in TASKS[:2]:
        clik = task.clik(state, Sample(pose, twist))
        assert np.abs(clik.velocity - 1.0).max() < 1e-5
    with pytest.raises(IndexError):
        TASKS[0].clik(state, Sample(np.eye(3), twist))
