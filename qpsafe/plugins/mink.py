"""For mink: `EvasiveTask`, `DangerLimit`, `JointLimit` and others go into an existing call of `mink.solve_ik`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.extras import require
from qpsafe.geometry.clearance import MARGIN
from qpsafe.plugins.checks import checked_cost
from qpsafe.plugins.clearance import Carried, ClearanceRows
from qpsafe.plugins.joints import JointMap, mujoco_joints
from qpsafe.plugins.monitor import DangerMonitor
from qpsafe.plugins.rows import BoxRows, ClikRows, DangerRows, EvasiveRows, ReleasableRows, TickRows
from qpsafe.robot.robot import Robot
from qpsafe.sensing.hulls import Obstacle
from qpsafe.tasks.task import Task

require("mink", "qpsafe.plugins.mink", "mink")
import mink  # noqa: E402

Array = NDArray[np.float64]

__all__ = [
    "ClearanceLimit", "ClikTask", "DangerLimit", "DangerMonitor", "EvasiveTask", "JointLimit", "ReleasableTask",
    "SameTick",
]  # fmt: skip


class EvasiveTask(EvasiveRows, mink.Task):  # type: ignore[misc]
    """Moves the robot away from danger: Δq = q̇0 dt, eq. (16), at a cost that grows with the danger.

    Without danger the cost is low, and the motion uses what the other tasks leave, as a posture task would. From
    Δ(1-ε) on the cost grows as cost² = c² + C² (1-m)/m, so that the evasive motion gets the share 1-m, eq. (18).

    Args:
        danger: What is near the robot; update it before each `solve_ik`.
        cost: c, its cost without danger, a number or (n,) [cost/rad]. Small against the other tasks' costs.
        against: C, about what the tasks cost that are to give way. With C = c the call is `WeightedLaw`.
        prefix: What stands before the joints' names in the model, as after `MjSpec.attach`.

    Raises:
        ConfigurationError: Names the argument that is wrong.
    """

    def __init__(self, danger: DangerMonitor, cost: ArrayLike = 0.03, against: float = 1.0, prefix: str = "") -> None:
        self.set_up(danger, cost, against, prefix)
        super().__init__(cost=self._calm_cost, gain=1.0, lm_damping=0.0)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the MuJoCo model."""
        return mujoco_joints(model, self.robot, self.prefix)


class ClikTask(ClikRows, mink.Task):  # type: ignore[misc]
    """One of qpsafe's tasks as mink's, the same rows exactly: J Δq = (ẋ_d + K e) dt.

    Args:
        task: The task; set `time` to where its trajectory is.
        robot: The robot it is for.
        dt: Tick [s], as given to `solve_ik`.
        cost: A number, or one for every row.
        prefix: What stands before the joints' names in the model.

    Raises:
        ConfigurationError: The robot cannot do the task, or K dt >= 1.
    """

    def __init__(self, task: Task, robot: Robot, dt: float, cost: ArrayLike = 1.0, prefix: str = "") -> None:
        self.set_up(task, robot, dt, prefix)
        rows = len(task.jacobian(robot.at(robot.home)))
        super().__init__(cost=checked_cost("ClikTask", cost, rows), gain=1.0, lm_damping=0.0)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the MuJoCo model."""
        return mujoco_joints(model, self.robot, self.prefix)


class ReleasableTask(ReleasableRows, mink.tasks.BaseTask):  # type: ignore[misc]
    """One of mink's tasks, released in danger before the first one, as Table I releases the low-priority task.

    With an `EvasiveTask` in the same call this is `WeightedLaw`: the weight of task k is a_k / a_1 = f ... of its own.

    Args:
        task: Any of mink's tasks.
        danger: What is near the robot.
        priority: 2 for the task that is released first of two, up to the number of the danger's thresholds.

    Raises:
        ConfigurationError: There is no such priority.
    """

    def __init__(self, task: Any, danger: DangerMonitor, priority: int = 2) -> None:
        if not isinstance(task, mink.tasks.BaseTask):
            raise ConfigurationError("ReleasableTask", "task", task, "one of mink's tasks")
        self.set_up(task, danger, priority)

    def compute_qp_objective(self, configuration: Any) -> Any:
        """The task's objective times a_k / a_1."""
        weight = self.release()
        H, c = self.task.compute_qp_objective(configuration)
        return mink.Objective(weight * H, weight * c)

    def compute_qp_residual(self, configuration: Any) -> Any:
        """The task's weighted rows times sqrt(a_k / a_1), if it has rows."""
        rows = self.task.compute_qp_residual(configuration)
        if rows is None:
            return None
        weight = self.release()
        return math.sqrt(weight) * rows[0], math.sqrt(weight) * rows[1], weight * rows[2]


class DangerLimit(DangerRows, mink.Limit):  # type: ignore[misc]
    """A cap on the danger field at the detected points: CDF(q, q̇, p) <= Δ_max.

    Args:
        danger: What is near the robot; update it before each `solve_ik`.
        delta_max: Δ_max [unit of CDF].
        horizon: τ, how far ahead the static field is predicted [s].
        points: How many of the most dangerous points get a row.
        prefix: What stands before the joints' names in the model.

    Raises:
        ConfigurationError: Names the argument that is wrong; at the first `solve_ik` also if its dt is another one.
    """

    def __init__(
        self, danger: DangerMonitor, delta_max: float, horizon: float = 0.2, points: int = 3, prefix: str = ""
    ) -> None:
        self.set_up(danger, delta_max, horizon, points, prefix)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the MuJoCo model."""
        return mujoco_joints(model, self.robot, self.prefix)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
        """G Δq <= h, `mink.Constraint`; inactive without points."""
        rows = self.rows(configuration, dt)
        return mink.Constraint() if rows is None else mink.Constraint(*rows)


class ClearanceLimit(ClearanceRows, mink.Limit):  # type: ignore[misc]
    """Keeps the robot a margin away from known obstacles, from what it carries and from itself.

    In place of mink's `CollisionAvoidanceLimit`: stopping in time within the acceleration limits, true distances of the
    convex hulls, several points of a pair, and no row where nothing can come too near.

    Args:
        danger: What knows the robot's state and limits; update it before each `solve_ik`.
        known: Obstacles that stand still, in the robot's own world frame.
        carried: What tools carry, by the frame it is fixed to and in its axes.
        margin: How near the robot may come [m].
        prefix: What stands before the joints' names in the model.

    Raises:
        ConfigurationError: Names the argument that is wrong; at the first `solve_ik` also if its dt is another one.
    """

    def __init__(
        self,
        danger: DangerMonitor,
        known: Sequence[Obstacle] = (),
        carried: Carried | None = None,
        margin: float = MARGIN,
        prefix: str = "",
    ) -> None:
        self.set_up(danger, known, carried, margin, prefix)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the MuJoCo model."""
        return mujoco_joints(model, self.robot, self.prefix)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
        """G Δq <= h, `mink.Constraint`; inactive where nothing can come too near."""
        rows = self.rows(configuration, dt)
        return mink.Constraint() if rows is None else mink.Constraint(*rows)


class JointLimit(BoxRows, mink.Limit):  # type: ignore[misc]
    """qpsafe's joint limits: position, velocity and acceleration in one box, never empty (derivations, section 4).

    In place of mink's `ConfigurationLimit` and `VelocityLimit`: a start outside a position limit comes back inside at
    bounded speed, where those contradict each other and `solve_ik` raises.

    Args:
        danger: What knows the robot's state and limits; update it before each `solve_ik`.
        prefix: What stands before the joints' names in the model.

    Raises:
        ConfigurationError: The monitor has no limits; at the first `solve_ik` also if its dt is another one.
    """

    def __init__(self, danger: DangerMonitor, prefix: str = "") -> None:
        self.set_up(danger, prefix)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the MuJoCo model."""
        return mujoco_joints(model, self.robot, self.prefix)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
        """lo dt <= Δq <= hi dt as G Δq <= h."""
        return mink.Constraint(*self.rows(configuration, dt))


class SameTick(TickRows, mink.Limit):  # type: ignore[misc]
    """No limit, but a check: refuses a `solve_ik` whose dt is not that of its parts.

    mink tells limits the dt of a call, and tasks nothing. `JointLimit`, `DangerLimit` and `ClearanceLimit` compare it
    with their monitor's; this is for calls without them, and for `ClikTask`s.

    Args:
        parts: Monitors and `ClikTask`s of the call.

    Raises:
        ConfigurationError: There are none; at a `solve_ik` if its dt is another one.
    """

    def __init__(self, *parts: DangerMonitor | ClikRows) -> None:
        self.set_up(parts)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
        """Inactive."""
        self.check(dt)
        return mink.Constraint()
