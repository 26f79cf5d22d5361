"""Tasks of mink and pink as qpsafe's: exactly, as rows of one instant, and as tasks for `SafetyController`.

mink and pink measure the error of a pose as one screw motion, log6(T_bt), in the moving frame; qpsafe measures shift
and turn apart, in the world. Orientations, and poses whose orientation is met, agree; otherwise they differ by the
product of the two errors. Gains: α per tick against K per second, K = α / dt.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.laws.problem import TaskVelocity
from qpsafe.pipeline.checks import checked_dt
from qpsafe.plugins.checks import DEAREST, checked_cost, checked_prefix
from qpsafe.plugins.joints import JointMap
from qpsafe.plugins.rows import ClikRows, ReleasableRows
from qpsafe.robot.robot import Robot
from qpsafe.robot.state import RobotState
from qpsafe.tasks.frame import FrameTask
from qpsafe.tasks.joint import JointTask, PostureTask
from qpsafe.tasks.task import Misfit, Task
from qpsafe.tasks.trajectory import FixedJoints, FixedPose
from qpsafe.text.given import number, numbers

Array = NDArray[np.float64]

#: Joints are moved by this to see whether a frame of theirs moves as the robot's [rad, m].
STEP = 0.3
#: So different may two models of one robot be; nearer than rounding they are one [m].
ALIKE, ROUNDING = 1e-3, 1e-9
_OF_ROWS = ("compute_error", "compute_jacobian", "cost", "gain", "lm_damping")


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

    Raises:
        ConfigurationError: A task without rows, or one that danger releases; a cost, damping or tick that is none.
    """
    dt = checked_dt("task_velocity", dt)
    if isinstance(task, ReleasableRows):
        expected = "the task inside it: a law releases by its problem's activations"
        raise ConfigurationError("task_velocity", "task", task, expected)
    if isinstance(task, type) or not all(hasattr(task, key) for key in _OF_ROWS):
        raise ConfigurationError("task_velocity", "task", task, "a task with an error and a Jacobian")
    refuse_damping(task)
    error, J = np.asarray(task.compute_error(configuration)), np.asarray(task.compute_jacobian(configuration))
    cost = row_costs(task, len(error))
    keep = cost > 0.0
    rows = J if joints is None else J[:, joints.v]
    return TaskVelocity((cost[:, None] * rows)[keep], (-cost * task.gain * error / dt)[keep])


def pose_task(
    robot: Robot, frame: str, target: Array, gain: float, cost: Array, dt: float, pose_at: Callable[[Array], Array]
) -> Task:
    """A mink or pink `FrameTask` as `FrameTask`: rows of zero cost left out, the others times their cost.

    Args:
        robot: Whose frame it is.
        frame: Its name.
        target: Pose (4, 4) in their world [m].
        pose_at: The frame's pose in their world (4, 4) [m] at joint positions (n,).
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
    own = FixedPose(in_own_world(robot, frame, target, pose_at))
    return priced(FrameTask(frame, own, rate(gain, dt), tuple(rows)), cost[rows])


def in_own_world(robot: Robot, frame: str, target: Array, pose_at: Callable[[Array], Array]) -> Array:
    """A pose in the world of a model as seen in the robot's own, which stands somewhere in it (4, 4) [m].

    Args:
        robot: Whose frame it is.
        frame: Its name.
        target: Pose in the model's world (4, 4) [m].
        pose_at: The frame's pose there (4, 4) [m] at joint positions (n,).

    Raises:
        ConfigurationError: The frame moves there otherwise than the robot's: it is another robot's, or another model.
    """
    step = np.where(robot.home + STEP <= robot.upper, STEP, -STEP)
    base, other = (pose_at(q) @ np.linalg.inv(robot.pose(frame, q)) for q in (robot.home, robot.home + step))
    if not np.allclose(base, other, rtol=0.0, atol=ALIKE):
        expected = f"a frame that moves in the model as {frame} of the robot's"
        raise ConfigurationError(f"robot {robot.name}", "frame", frame, expected)
    if np.allclose(base, np.eye(4), rtol=0.0, atol=ROUNDING):
        return target
    return np.asarray(np.linalg.inv(base) @ target)


def own_name(where: str, name: Any, prefix: str) -> str:
    """What the robot's file calls a frame of the model.

    Args:
        where: Who asks, for the error.
        name: In the model.
        prefix: What stands before the names there.
    """
    prefix = checked_prefix(where, prefix)
    if not (isinstance(name, str) and name.startswith(prefix)):
        raise ConfigurationError(where, "frame", name, f"a frame of the robot's, whose names begin with {prefix!r}")
    return name[len(prefix) :]


def posture_task(posture: Array, gain: float, cost: Array, dt: float) -> Task:
    """A mink or pink `PostureTask` as `PostureTask`, or as `JointTask` where some joints cost nothing.

    A joint that turns without end takes the short way then; theirs takes the long one from more than half a turn away.

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


def posture_of(task: Task, robot: Robot) -> tuple[Array, Array | None] | None:
    """Fixed joint positions that a task asks for and the joints it does so for; None for a task that theirs are not.

    Args:
        task: One of qpsafe's.
        robot: Whose task it is. A joint of it that turns without end takes the short way, unlike theirs.
    """
    if not isinstance(task, JointTask) or not isinstance(task.trajectory, FixedJoints):
        return None
    joints = None if task.joints is None else np.array(task.joints)
    if (robot.endless if joints is None else robot.endless[joints]).any():
        return None
    return task.trajectory.position, joints


def target_of(task: Any, nq: int) -> Array:
    """Where a `PostureTask` of theirs leads (nq,) [rad].

    Args:
        task: Theirs.
        nq: Length of the model's position vector.
    """
    expected = f"a target of {nq} numbers; see its set_target"
    target = numbers("PostureTask", "target_q", task.target_q, expected, 1)
    if len(target) != nq:
        raise ConfigurationError("PostureTask", "target_q", task.target_q, expected)
    return target


def costs_of(where: str, cost: float, own: Array | float) -> Array:
    """Costs of the rows of a task that becomes theirs.

    Args:
        where: Who asks, for the error.
        cost: Of all rows, as given.
        own: What a `CostTask` says.
    """
    return number(where, "cost", cost, f"a number from 0 to {DEAREST:g}", 0.0, most=DEAREST) * np.asarray(own)


def rate(gain: float, dt: float) -> float:
    """K = α / dt [1/s]."""
    return number("conversion", "gain", gain, "more than 0", above=0.0) / checked_dt("conversion", dt)


def row_costs(task: Any, rows: int) -> Array:
    """Cost of each row of a task of mink or pink, (rows,)."""
    return checked_cost(type(task).__name__, 1.0 if task.cost is None else task.cost, rows)


def refuse_damping(task: Any) -> None:
    """Levenberg-Marquardt damping depends on the error and has no place in a row."""
    if task.lm_damping != 0.0:
        expected = "0: qpsafe damps by HierarchicalLaw(damping=...)"
        raise ConfigurationError(type(task).__name__, "lm_damping", task.lm_damping, expected)
