"""Tasks of pink as qpsafe's, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.pipeline.checks import checked_robot
from qpsafe.plugins.checks import checked_prefix
from qpsafe.plugins.convert import (
    costs_of,
    original,
    own_name,
    pose_task,
    posture_of,
    posture_task,
    refuse_damping,
    row_costs,
    target_of,
    unpriced,
)
from qpsafe.plugins.joints import pinocchio_joints
from qpsafe.plugins.mink_convert import robot_frame
from qpsafe.plugins.pink import ClikTask
from qpsafe.robot.robot import Robot
from qpsafe.tasks.task import Task

from pink.tasks import FrameTask as PinkFrameTask  # isort: skip  after qpsafe.plugins.pink, which says what is missing
from pink.tasks import PostureTask as PinkPostureTask  # isort: skip

Array = NDArray[np.float64]

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
        ConfigurationError: As for mink.
    """
    joints = pinocchio_joints(model, checked_robot("from_pink", robot), checked_prefix("from_pink", prefix))
    found = original(task)
    if found is not None:
        return found
    if type(task) not in (PinkFrameTask, PinkPostureTask):
        expected = "a FrameTask, PostureTask or ClikTask; task_velocity() takes others"
        raise ConfigurationError("from_pink", "task", type(task).__name__, expected)
    refuse_damping(task)
    if type(task) is PinkPostureTask:
        return posture_task(target_of(task, model.nq)[joints.q], task.gain, row_costs(task, robot.nq), dt)
    if task.transform_target_to_world is None:
        raise ConfigurationError("FrameTask", "transform_target_to_world", None, "a target; see its set_target")
    frame = robot_frame(robot, own_name("FrameTask", task.frame, prefix))
    if not model.existFrame(task.frame):
        raise ConfigurationError("FrameTask", "frame", task.frame, "a frame of the model")
    data, number, configuration = model.createData(), model.getFrameId(task.frame), pin.neutral(model)

    def pose_at(q: Array) -> Array:
        configuration[joints.q] = q
        pin.framesForwardKinematics(model, data, configuration)
        return np.asarray(data.oMf[number].homogeneous)

    target = task.transform_target_to_world.homogeneous
    return pose_task(robot, frame, target, task.gain, row_costs(task, 6), dt, pose_at)


def to_pink(task: Task, robot: Robot, model: Any, dt: float, cost: float = 1.0, prefix: str = "") -> Any:
    """One of qpsafe's tasks as pink's: the same rows exactly, α = K dt.

    All joints of the model that are to stay in a posture, at one cost, become pink's own `PostureTask`, unless one of
    them turns without end, all else a `ClikTask`. Arguments and errors as for `qpsafe.plugins.mink_convert.to_mink`,
    with a pinocchio model.

    Args:
        task: One of qpsafe's.
        robot: Whose task it is.
        model: pinocchio's.
        dt: Step [s].
        cost: Of every row.
        prefix: Before the joints' names in the model.
    """
    inner, own_cost = unpriced(task)
    result = ClikTask(inner, robot, dt, costs_of("to_pink", cost, own_cost), prefix)
    place = pinocchio_joints(model, robot, prefix)
    found = posture_of(inner, robot)
    one_cost = bool(np.all(result.cost == result.cost[0]))
    if found is None or found[1] is not None or not one_cost or model.nv != robot.nq:
        return result
    target = np.empty(model.nq)
    target[place.q] = found[0]
    native = PinkPostureTask(cost=float(result.cost[0]), gain=inner.gain * dt)
    native.set_target(target)
    return native
