"""Tasks of pink as qpsafe's, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from qpsafe.errors import ConfigurationError
from qpsafe.plugins.convert import original, pose_task, posture_of, posture_task, refuse_damping, row_costs, unpriced
from qpsafe.plugins.joints import pinocchio_joints
from qpsafe.plugins.mink_convert import robot_frame
from qpsafe.plugins.pink import ClikTask
from qpsafe.robot.robot import Robot
from qpsafe.tasks.task import Task

from pink.tasks import FrameTask as PinkFrameTask  # isort: skip  after qpsafe.plugins.pink, which says what is missing
from pink.tasks import PostureTask as PinkPostureTask  # isort: skip

__all__ = ["from_pink", "to_pink"]


def from_pink(task: Any, robot: Robot, model: Any, dt: float, prefix: str = "") -> Task:
    """One of pink's tasks as qpsafe's; as `qpsafe.plugins.mink_convert.from_mink`, with a pinocchio model.

    Args:
        task: One of pink's.
        robot: Whose task it becomes.
        model: pinocchio's.
        dt: Step [s].
        prefix: Before the joints' names in the model.

    Raises:
        ConfigurationError: A kind of task, frame, cost or damping that has no counterpart.
    """
    found = original(task)
    if found is not None:
        return found
    refuse_damping(task)
    if type(task) is PinkFrameTask:
        if task.transform_target_to_world is None:
            raise ConfigurationError("FrameTask", "transform_target_to_world", None, "a target; see its set_target")
        frame = robot_frame(robot, task.frame.removeprefix(prefix))
        target = task.transform_target_to_world.homogeneous
        return pose_task(robot, frame, target, task.gain, row_costs(task, 6), dt)
    if type(task) is PinkPostureTask:
        if task.target_q is None:
            raise ConfigurationError("PostureTask", "target_q", None, "a target; see its set_target")
        joints = pinocchio_joints(model, robot, prefix)
        return posture_task(task.target_q[joints.q], task.gain, row_costs(task, robot.nq), dt)
    expected = "a FrameTask, PostureTask or ClikTask; task_velocity() takes any other"
    raise ConfigurationError("from_pink", "task", type(task).__name__, expected)


def to_pink(task: Task, robot: Robot, model: Any, dt: float, cost: float = 1.0, prefix: str = "") -> Any:
    """One of qpsafe's tasks as pink's: the same rows exactly, α = K dt.

    All joints of the model that are to stay in a posture, at one cost, become pink's own `PostureTask`, all else a
    `ClikTask`. Arguments and errors as for `qpsafe.plugins.mink_convert.to_mink`, with a pinocchio model.

    Args:
        task: One of qpsafe's.
        robot: Whose task it is.
        model: pinocchio's.
        dt: Step [s].
        cost: Of every row.
        prefix: Before the joints' names in the model.
    """
    inner, own_cost = unpriced(task)
    result = ClikTask(inner, robot, dt, cost * np.asarray(own_cost), prefix)
    found = posture_of(inner)
    one_cost = bool(np.all(result.cost == result.cost[0]))
    if found is None or found[1] is not None or not one_cost or model.nv != robot.nq:
        return result
    target = np.empty(model.nq)
    target[pinocchio_joints(model, robot, prefix).q] = found[0]
    native = PinkPostureTask(cost=float(result.cost[0]), gain=inner.gain * dt)
    native.set_target(target)
    return native
