"""Tasks of mink as qpsafe's, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.plugins.convert import original, pose_task, posture_of, posture_task, refuse_damping, row_costs, unpriced
from qpsafe.plugins.joints import mujoco_joints
from qpsafe.plugins.mink import ClikTask
from qpsafe.robot.robot import Robot
from qpsafe.tasks.task import Task

import mink  # isort: skip  after qpsafe.plugins.mink, which says what is missing

__all__ = ["from_mink", "to_mink"]


def from_mink(task: Any, robot: Robot, model: Any, dt: float, prefix: str = "") -> Task:
    """One of mink's tasks as qpsafe's, e.g. for `SafetyController`.

    A `FrameTask` on a body or site becomes a `FrameTask` (rows without cost left out), a `PostureTask` becomes a
    `PostureTask` or `JointTask`, a `ClikTask` what it was made of. Gains become K = α / dt, costs a `CostTask` around.
    For laws rather than for a controller, `qpsafe.plugins.convert.task_velocity` takes any task, exactly.

    Args:
        task: The task, its target set.
        robot: The robot, in whose world targets are.
        model: The `mujoco.MjModel` that the task is for.
        dt: Tick [s].
        prefix: What stands before the names in the model.

    Raises:
        ConfigurationError: A kind of task, frame, cost or damping that has no counterpart.
    """
    found = original(task)
    if found is not None:
        return found
    refuse_damping(task)
    if type(task) is mink.FrameTask:
        if task.transform_target_to_world is None:
            raise ConfigurationError("FrameTask", "transform_target_to_world", None, "a target; see its set_target")
        if task.frame_type not in ("body", "site"):
            raise ConfigurationError("FrameTask", "frame_type", task.frame_type, '"body" or "site"')
        kind = {"body": model.body, "site": model.site}[task.frame_type]
        name = kind(task.frame_name).name
        frame = robot_frame(robot, name.removeprefix(prefix))
        target = task.transform_target_to_world.as_matrix()
        return pose_task(robot, frame, target, task.gain, row_costs(task, 6), dt)
    if type(task) is mink.PostureTask:
        if task.target_q is None:
            raise ConfigurationError("PostureTask", "target_q", None, "a target; see its set_target")
        joints = mujoco_joints(model, robot, prefix)
        return posture_task(task.target_q[joints.q], task.gain, row_costs(task, model.nv)[joints.v], dt)
    expected = "a FrameTask, PostureTask or ClikTask; task_velocity() takes any other"
    raise ConfigurationError("from_mink", "task", type(task).__name__, expected)


def to_mink(task: Task, robot: Robot, model: Any, dt: float, cost: float = 1.0, prefix: str = "") -> Any:
    """One of qpsafe's tasks as mink's: the same rows exactly, α = K dt.

    Joints that are to stay in a posture become mink's own `PostureTask`, all else a `ClikTask`.

    Args:
        task: The task.
        robot: The robot it is for.
        model: The `mujoco.MjModel` that it is to run on.
        dt: Tick [s].
        cost: Of all rows, times what a `CostTask` says.
        prefix: What stands before the names in the model.

    Raises:
        ConfigurationError: The robot cannot do the task, or K dt >= 1.
    """
    inner, own_cost = unpriced(task)
    result = ClikTask(inner, robot, dt, cost * np.asarray(own_cost), prefix)
    found = posture_of(inner)
    if found is None:
        return result
    posture, joints = found
    place = mujoco_joints(model, robot, prefix)
    costs: NDArray[np.float64] = np.zeros(model.nv)
    costs[place.v if joints is None else place.v[joints]] = result.cost
    target = np.array(model.qpos0)
    target[place.q] = posture
    native = mink.PostureTask(model, costs, gain=inner.gain * dt)
    native.set_target(target)
    return native


def robot_frame(robot: Robot, name: str) -> str:
    """What qpsafe calls a site or body of the robot's model.

    Raises:
        ConfigurationError: The robot's file gives it no name.
    """
    for frame in robot.frame_names:
        if name in (frame, robot.model.frames[robot.frame_id(frame)].name):
            return frame
    raise ConfigurationError(
        f"robot {robot.name}", "frame", name, "a frame of its file: " + ", ".join(robot.frame_names)
    )
