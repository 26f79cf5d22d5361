"""Tasks of mink as qpsafe's, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
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
from qpsafe.plugins.joints import mujoco_joints
from qpsafe.plugins.mink import ClikTask
from qpsafe.robot.robot import Robot
from qpsafe.tasks.task import Task

import mink  # isort: skip  after qpsafe.plugins.mink, which says what is missing
import mujoco  # isort: skip

Array = NDArray[np.float64]

__all__ = ["from_mink", "to_mink"]


def from_mink(task: Any, robot: Robot, model: Any, dt: float, prefix: str = "") -> Task:
    """One of mink's tasks as qpsafe's, e.g. for `SafetyController`.

    A `FrameTask` on a body or site becomes a `FrameTask` (rows without cost left out), a `PostureTask` becomes a
    `PostureTask` or `JointTask`, a `ClikTask` what it was made of. Gains become K = α / dt, costs a `CostTask` around.
    For laws rather than for a controller, `qpsafe.plugins.convert.task_velocity` takes any task, exactly. A robot may
    stand anywhere in the model's world, at rest: the target is that in its own. A posture's joint that turns without
    end takes the short way; mink's takes the long one where it is more than half a turn away.

    Args:
        task: The task, its target set.
        robot: The robot.
        model: The `mujoco.MjModel` that the task is for.
        dt: Tick [s].
        prefix: What stands before the names in the model.

    Raises:
        ConfigurationError: A kind of task, frame, cost or damping that has no counterpart; a frame that is not the
            robot's, or moves otherwise; joints as for `mujoco_joints`.
    """
    joints = mujoco_joints(model, checked_robot("from_mink", robot), checked_prefix("from_mink", prefix))
    found = original(task)
    if found is not None:
        return found
    if type(task) not in (mink.FrameTask, mink.PostureTask):
        expected = "a FrameTask, PostureTask or ClikTask; task_velocity() takes others"
        raise ConfigurationError("from_mink", "task", type(task).__name__, expected)
    refuse_damping(task)
    if type(task) is mink.PostureTask:
        target = target_of(task, model.nq)[joints.q]
        return posture_task(target, task.gain, row_costs(task, model.nv)[joints.v], dt)
    if task.transform_target_to_world is None:
        raise ConfigurationError("FrameTask", "transform_target_to_world", None, "a target; see its set_target")
    if task.frame_type not in ("body", "site"):
        raise ConfigurationError("FrameTask", "frame_type", task.frame_type, '"body" or "site"')
    kind = {"body": mujoco.mjtObj.mjOBJ_BODY, "site": mujoco.mjtObj.mjOBJ_SITE}[task.frame_type]
    frame = robot_frame(robot, own_name("FrameTask", task.frame_name, prefix))
    number = mujoco.mj_name2id(model, kind, task.frame_name)
    if number < 0:
        expected = f"a {task.frame_type} of the model"
        raise ConfigurationError("FrameTask", "frame_name", task.frame_name, expected)
    data = mujoco.MjData(model)

    def pose_at(q: Array) -> Array:
        data.qpos[joints.q] = q
        mujoco.mj_kinematics(model, data)
        there = data.body(number) if task.frame_type == "body" else data.site(number)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = there.xmat.reshape(3, 3), there.xpos
        return pose

    target = task.transform_target_to_world.as_matrix()
    return pose_task(robot, frame, target, task.gain, row_costs(task, 6), dt, pose_at)


def to_mink(task: Task, robot: Robot, model: Any, dt: float, cost: float = 1.0, prefix: str = "") -> Any:
    """One of qpsafe's tasks as mink's: the same rows exactly, α = K dt.

    Joints that are to stay in a posture become mink's own `PostureTask`, unless one of them turns without end, all else
    a `ClikTask`.

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
    result = ClikTask(inner, robot, dt, costs_of("to_mink", cost, own_cost), prefix)
    place = mujoco_joints(model, robot, prefix)
    found = posture_of(inner, robot)
    if found is None:
        return result
    posture, joints = found
    costs: Array = np.zeros(model.nv)
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
