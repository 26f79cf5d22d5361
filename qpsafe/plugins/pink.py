"""For pink: `EvasiveTask`, `DangerLimit`, `JointLimit` and others go into an existing call of `pink.solve_ik`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.extras import require
from qpsafe.geometry.clearance import MARGIN
from qpsafe.plugins.checks import checked_cost
from qpsafe.plugins.clearance import Carried, ClearanceRows
from qpsafe.plugins.joints import JointMap, pinocchio_joints
from qpsafe.plugins.monitor import DangerMonitor
from qpsafe.plugins.rows import BoxRows, ClikRows, DangerRows, EvasiveRows, ReleasableRows, TickRows
from qpsafe.robot.robot import Robot
from qpsafe.sensing.hulls import Obstacle
from qpsafe.tasks.task import Task

require("pink", "qpsafe.plugins.pink", "pink")
from pink.barriers import Barrier as PinkBarrier  # noqa: E402
from pink.limits import Limit as PinkLimit  # noqa: E402
from pink.tasks import Task as PinkTask  # noqa: E402

Array = NDArray[np.float64]

__all__ = [
    "ClearanceBarrier", "ClearanceLimit", "ClikTask", "DangerLimit", "DangerMonitor", "EvasiveTask", "JointLimit",
    "ReleasableTask", "SameTick",
]  # fmt: skip


class EvasiveTask(EvasiveRows, PinkTask):  # type: ignore[misc]
    """Moves the robot away from danger: Δq = q̇0 dt, eq. (16), at a cost that grows with the danger.

    As `qpsafe.plugins.mink.EvasiveTask`, with the same arguments.

    Args:
        danger: What is near the robot; update it before each `solve_ik`.
        cost: c, its cost without danger, a number or (n,) [cost/rad]. Small against the other tasks' costs.
        against: C, about what the tasks cost that are to give way.
        prefix: What stands before the joints' names in the model.
    """

    def __init__(self, danger: DangerMonitor, cost: ArrayLike = 0.03, against: float = 1.0, prefix: str = "") -> None:
        self.set_up(danger, cost, against, prefix)
        super().__init__(cost=self._calm_cost, gain=1.0, lm_damping=0.0)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the pinocchio model."""
        return pinocchio_joints(model, self.robot, self.prefix)

    def __repr__(self) -> str:
        return f"EvasiveTask(cost={self.cost}, against={self.against})"


class ClikTask(ClikRows, PinkTask):  # type: ignore[misc]
    """One of qpsafe's tasks as pink's, the same rows exactly: J Δq = (ẋ_d + K e) dt.

    As `qpsafe.plugins.mink.ClikTask`, with the same arguments.

    Args:
        task: The task; set `time` to where its trajectory is.
        robot: The robot it is for.
        dt: Tick [s], as given to `solve_ik`.
        cost: A number, or one for every row.
        prefix: What stands before the joints' names in the model.
    """

    def __init__(self, task: Task, robot: Robot, dt: float, cost: ArrayLike = 1.0, prefix: str = "") -> None:
        self.set_up(task, robot, dt, prefix)
        rows = len(task.jacobian(robot.at(robot.home)))
        super().__init__(cost=checked_cost("ClikTask", cost, rows), gain=1.0, lm_damping=0.0)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the pinocchio model."""
        return pinocchio_joints(model, self.robot, self.prefix)

    def __repr__(self) -> str:
        return f"ClikTask({self.task.name}, cost={self.cost}, dt={self.dt})"


class ReleasableTask(ReleasableRows, PinkTask):  # type: ignore[misc]
    """One of pink's tasks, released in danger before the first one, as Table I releases the low-priority task.

    As `qpsafe.plugins.mink.ReleasableTask`, with the same arguments.

    Args:
        task: Any of pink's tasks.
        danger: What is near the robot.
        priority: 2 for the task that is released first of two, up to the number of the danger's thresholds.
    """

    def __init__(self, task: Any, danger: DangerMonitor, priority: int = 2) -> None:
        if not isinstance(task, PinkTask):
            raise ConfigurationError("ReleasableTask", "task", task, "one of pink's tasks")
        super().__init__(cost=task.cost, gain=task.gain, lm_damping=task.lm_damping)
        self.set_up(task, danger, priority)

    def compute_error(self, configuration: Any) -> Array:
        """The task's own."""
        return np.asarray(self.task.compute_error(configuration))

    def compute_jacobian(self, configuration: Any) -> Array:
        """The task's own."""
        return np.asarray(self.task.compute_jacobian(configuration))

    def compute_qp_objective(self, configuration: Any) -> tuple[Array, Array]:
        """The task's objective times a_k / a_1."""
        weight = self.release()
        H, c = self.task.compute_qp_objective(configuration)
        return weight * H, weight * c

    def __repr__(self) -> str:
        return f"ReleasableTask({self.task!r}, priority={self.priority})"


class DangerLimit(DangerRows, PinkLimit):  # type: ignore[misc]
    """A cap on the danger field at the detected points: CDF(q, q̇, p) <= Δ_max.

    As `qpsafe.plugins.mink.DangerLimit`, with the same arguments.

    Args:
        danger: What is near the robot; update it before each `solve_ik`.
        delta_max: Δ_max [unit of CDF].
        horizon: τ, how far ahead the static field is predicted [s].
        points: How many of the most dangerous points get a row.
        prefix: What stands before the joints' names in the model.
    """

    def __init__(
        self, danger: DangerMonitor, delta_max: float, horizon: float = 0.2, points: int = 3, prefix: str = ""
    ) -> None:
        self.set_up(danger, delta_max, horizon, points, prefix)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the pinocchio model."""
        return pinocchio_joints(model, self.robot, self.prefix)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array] | None:
        """G Δq <= h; None without points."""
        return self.rows(configuration, dt)


class ClearanceLimit(ClearanceRows, PinkLimit):  # type: ignore[misc]
    """Keeps the robot a margin away from known obstacles, from what it carries and from itself.

    As `qpsafe.plugins.mink.ClearanceLimit`, with the same arguments; among pink's `limits`.

    Args:
        danger: What knows the robot's state and limits; update it before each `solve_ik`.
        known: Obstacles that stand still, in the robot's own world frame.
        carried: What tools carry, by the frame it is fixed to and in its axes.
        margin: How near the robot may come [m].
        prefix: What stands before the joints' names in the model.
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
        """By name in the pinocchio model."""
        return pinocchio_joints(model, self.robot, self.prefix)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array] | None:
        """G Δq <= h; None where nothing can come too near."""
        return self.rows(configuration, dt)


class ClearanceBarrier(ClearanceRows, PinkBarrier):  # type: ignore[misc]
    """The same rows among pink's `barriers`; it adds nothing to the objective.

    Args:
        danger: What knows the robot's state and limits; update it before each `solve_ik`.
        known: Obstacles that stand still, in the robot's own world frame.
        carried: What tools carry, by the frame it is fixed to and in its axes.
        margin: How near the robot may come [m].
        prefix: What stands before the joints' names in the model.
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
        super().__init__(dim=0)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the pinocchio model."""
        return pinocchio_joints(model, self.robot, self.prefix)

    def compute_barrier(self, configuration: Any) -> Array:
        """Distance less margin of each row (rows,) [m]."""
        found = self.level(configuration, self.danger.dt)
        return np.zeros(0) if found is None else found[0].gaps - self.clearance.margin

    def compute_jacobian(self, configuration: Any) -> Array:
        """Of these distances (rows, nv)."""
        found = self.level(configuration, self.danger.dt)
        A = np.zeros((0, self.robot.nq)) if found is None else found[0].A
        return -self.joints(configuration).spread(A)

    def compute_qp_objective(self, configuration: Any) -> tuple[Array, Array]:
        """Nothing."""
        nv = configuration.model.nv
        return np.zeros((nv, nv)), np.zeros(nv)

    def compute_qp_inequalities(self, configuration: Any, dt: float = 1e-3) -> tuple[Array, Array]:
        """G Δq <= h."""
        rows = self.rows(configuration, dt)
        return (np.zeros((0, configuration.model.nv)), np.zeros(0)) if rows is None else rows


class JointLimit(BoxRows, PinkLimit):  # type: ignore[misc]
    """qpsafe's joint limits: position, velocity and acceleration in one box, never empty (derivations, section 4).

    As `qpsafe.plugins.mink.JointLimit`, with the same arguments.
    """

    def __init__(self, danger: DangerMonitor, prefix: str = "") -> None:
        self.set_up(danger, prefix)

    def find_joints(self, model: Any) -> JointMap:
        """By name in the pinocchio model."""
        return pinocchio_joints(model, self.robot, self.prefix)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array]:
        """lo dt <= Δq <= hi dt as G Δq <= h."""
        return self.rows(configuration, dt)


class SameTick(TickRows, PinkLimit):  # type: ignore[misc]
    """No limit, but a check: refuses a `solve_ik` whose dt is not that of its parts.

    As `qpsafe.plugins.mink.SameTick`, with the same arguments.

    Args:
        parts: Monitors and `ClikTask`s of the call.
    """

    def __init__(self, *parts: DangerMonitor | ClikRows) -> None:
        self.set_up(parts)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> None:
        """Nothing."""
        self.check(dt)
