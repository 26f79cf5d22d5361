"""Tasks of mink and pink as qpsafe's: exactly, as rows of one instant, and as tasks for `SafetyController`.

mink and pink measure the error of a pose as one screw motion, log6(T_bt), in the moving frame; qpsafe measures shift
and turn apart, in the world. Orientations, and poses whose orientation is met, agree; otherwise they differ by the
product of the two errors. Gains: α per tick against K per second, K = α / dt.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.laws.problem import TaskVelocity
from qpsafe.pipeline.checks import checked_dt
from qpsafe.plugins.joints import JointMap
from qpsafe.plugins.rows import ClikRows, checked_cost
from qpsafe.robot.robot import Robot
from qpsafe.robot.state import RobotState
from qpsafe.tasks.frame import FrameTask
from qpsafe.tasks.joint import JointTask, PostureTask
from qpsafe.tasks.task import Misfit, Task
from qpsafe.tasks.trajectory import FixedJoints, FixedPose

Array = NDArray[np.float64]


class CostTask(Task):
    """A task whose rows count differently: rows and CLIK velocity times a cost each, the error in its own units.

    Args:
        task: The task.
        cost: (rows,) or a number.
    """

    def __init__(self, task: Task, cost: Array | float) -> None:
        super().__init__(task.trajectory, task.gain)
        self.task = task
        self.cost = np.asarray(cost, dtype=float)
        self.name, self.frames, self.essential = task.name, task.frames, task.essential

    def value(self, state: RobotState) -> Array:
        """The task's own."""
        return self.task.value(state)

    def error(self, value: Array, sample: Any) -> Array:
        """The task's own, not scaled."""
        return self.task.error(value, sample)

    def offset(self, value: Array, sample: Any) -> Array:
        """The task's own."""
        return self.task.offset(value, sample)

    def jacobian(self, state: RobotState) -> Array:
        """cost J, (rows, n)."""
        return (self.cost * self.task.jacobian(state).T).T

    def velocity(self, error: Array, sample: Any) -> Array:
        """cost (ẋ_d + K e), (rows,)."""
        return self.cost * self.task.velocity(error, sample)

    def misfit(self, robot: Robot) -> Misfit | None:
        """The task's own."""
        return self.task.misfit(robot)


def task_velocity(task: Any, configuration: Any, dt: float, joints: JointMap | None = None) -> TaskVelocity:
    """What any task of mink or pink asks for now, exactly, as rows for a law: cost J q̇ = -cost α e / dt.

    Args:
        task: A task with an error and a Jacobian.
        configuration: mink's or pink's.
        dt: Tick [s].
        joints: The robot's joints in its model; all of them if None. Rows that also move other joints say less then.

    Returns:
        Rows over the robot's joints; those of zero cost are left out.
    """
    refuse_damping(task)
    error, J = np.asarray(task.compute_error(configuration)), np.asarray(task.compute_jacobian(configuration))
    cost = row_costs(task, len(error))
    keep = cost > 0.0
    rows = J if joints is None else J[:, joints.v]
    return TaskVelocity((cost[:, None] * rows)[keep], (-cost * task.gain * error / dt)[keep])


def pose_task(robot: Robot, frame: str, target: Array, gain: float, cost: Array, dt: float) -> Task:
    """A mink or pink `FrameTask` as `FrameTask`: rows of zero cost left out, the others times their cost.

    Args:
        robot: Whose frame it is.
        frame: Its name.
        target: Pose (4, 4) [m].
        gain: Theirs, the part α of the error removed per step.
        cost: Of the six rows, (6,).
        dt: Step [s]; K = α/dt.
    """
    rows = np.flatnonzero(cost > 0.0)
    if len(rows) == 0:
        raise ConfigurationError("FrameTask", "cost", cost, "at least one row that costs something")
    same_axes = all(len(set(part)) == 1 for part in (cost[:3], cost[3:]))
    if not same_axes:
        expected = "one cost for the position and one for the orientation: its axes are the frame's, ours the world's"
        raise ConfigurationError("FrameTask", "cost", cost, expected)
    return priced(FrameTask(frame, FixedPose(target), rate(gain, dt), tuple(rows)), cost[rows])


def posture_task(posture: Array, gain: float, cost: Array, dt: float) -> Task:
    """A mink or pink `PostureTask` as `PostureTask`, or as `JointTask` where some joints cost nothing.

    Args:
        posture: Joint positions (n,) [rad].
        gain: Theirs, the part α of the error removed per step.
        cost: Of the joints, (n,).
        dt: Step [s]; K = α/dt.
    """
    joints = np.flatnonzero(cost > 0.0)
    if len(joints) == 0:
        raise ConfigurationError("PostureTask", "cost", cost, "at least one joint that costs something")
    K = rate(gain, dt)
    task = PostureTask(posture, K) if len(joints) == len(cost) else JointTask(FixedJoints(posture), K, list(joints))
    return priced(task, cost[joints])


def original(task: Any) -> Task | None:
    """The task inside a `ClikTask`, None for any other."""
    return priced(task.task, task.cost) if isinstance(task, ClikRows) else None


def priced(task: Task, cost: Array) -> Task:
    """The task itself where every row costs 1."""
    return task if bool(np.all(cost == 1.0)) else CostTask(task, cost)


def unpriced(task: Task) -> tuple[Task, Array | float]:
    """A task and its rows' cost."""
    return (task.task, task.cost) if isinstance(task, CostTask) else (task, 1.0)


def posture_of(task: Task) -> tuple[Array, Array | None] | None:
    """Fixed joint positions that a task asks for and the joints it does so for; None for any other task."""
    if not isinstance(task, JointTask) or not isinstance(task.trajectory, FixedJoints):
        return None
    return task.trajectory.position, None if task.joints is None else np.array(task.joints)


def rate(gain: float, dt: float) -> float:
    """K = α / dt [1/s]."""
    dt = checked_dt("conversion", dt)
    if not gain > 0.0:
        raise ConfigurationError("conversion", "gain", gain, "more than 0")
    return gain / dt


def row_costs(task: Any, rows: int) -> Array:
    """Cost of each row of a task of mink or pink, (rows,)."""
    return checked_cost(type(task).__name__, 1.0 if task.cost is None else task.cost, rows)


def refuse_damping(task: Any) -> None:
    """Levenberg-Marquardt damping depends on the error and has no place in a row."""
    if task.lm_damping != 0.0:
        expected = "0: qpsafe damps by HierarchicalLaw(damping=...)"
        raise ConfigurationError(type(task).__name__, "lm_damping", task.lm_damping, expected)
