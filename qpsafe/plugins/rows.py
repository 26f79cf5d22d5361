"""What the plug-ins for mink and pink have in common: rows J Δq = -α e, their costs, and G Δq <= h.

mink and pink ask a task for its error e and its Jacobian J and minimise ||cost (J Δq + α e)||² over the step Δq = q̇ dt
of one tick, α in [0, 1] being the gain. qpsafe asks for J q̇ = ẋ_d + K e (CLIK). The same rows, therefore:

    α = 1,  e = -(ẋ_d + K e_qpsafe) dt        or, with a reference at rest,        α = K dt,  e = -e_qpsafe
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.pipeline.checks import ABSURD_STEP, checked_dt, checked_robot
from qpsafe.plugins.checks import (
    DEAREST,
    check_tick,
    checked_cost,
    checked_danger,
    checked_prefix,
    checked_priority,
    same_tick,
    updated,
)
from qpsafe.plugins.joints import JointMap
from qpsafe.plugins.monitor import DangerMonitor
from qpsafe.robot.robot import Robot
from qpsafe.robot.state import RobotState
from qpsafe.tasks.task import Task
from qpsafe.text.given import number, numbers

Array = NDArray[np.float64]
_FLOAT = np.dtype(np.float64)

#: m counts as at least this where a cost is divided by it: a released task keeps a millionth of the weight.
LEAST = 1e-6


class OnRobot:
    """Finds the robot in the configuration it is given; the place of its joints is looked up once a model."""

    robot: Robot
    prefix: str
    _joints: tuple[Any, JointMap] | None = None
    _state: RobotState | None = None

    def find_joints(self, model: Any) -> JointMap:
        """The robot's joints in a model."""
        raise NotImplementedError

    def joints(self, configuration: Any) -> JointMap:
        """The robot's joints in the model of a configuration."""
        if self._joints is None or self._joints[0] is not configuration.model:
            self._joints = configuration.model, self.find_joints(configuration.model)
        return self._joints[1]

    def at(self, configuration: Any) -> RobotState:
        """The robot at a configuration, kept until the configuration changes."""
        q = np.asarray(configuration.q)[self.joints(configuration).q]
        if self._state is None or not np.array_equal(self._state.q, q):
            self._state = self.robot.at(q)
        return self._state


class EvasiveRows(OnRobot):
    """Δq = q̇0 dt, with a cost that grows as the tasks' release proceeds: cost² = c² + C² (1-m)/m.

    Of two wishes with the weights w and w (1-m)/m the compromise is m times the first and (1-m) times the second: the
    paper's blend (18), if C is about what the tasks cost that are to be released. With C = c the cost is c/sqrt(m),
    and a call of `solve_ik` is `WeightedLaw`, whose weights m w and w_E are divided by m.
    """

    danger: DangerMonitor
    against: float
    _calm_cost: Array

    def set_up(self, danger: DangerMonitor, cost: ArrayLike, against: float, prefix: str) -> None:
        """Check and keep the arguments of the constructor.

        Args:
            danger: What is near the robot.
            cost: Without danger, a number or (n,).
            against: About what the tasks cost that are to give way.
            prefix: What stands before the joints' names in the model.
        """
        self.danger, self.prefix = checked_danger("EvasiveTask", danger), checked_prefix("EvasiveTask", prefix)
        self.robot = danger.robot
        self.against = number("EvasiveTask", "against", against, f"a cost >= 0, up to {DEAREST:g}", 0.0, most=DEAREST)
        self.cost = cost

    @property
    def cost(self) -> Array:
        """Cost of every joint (n,) at present; set it to its value without danger."""
        m = max(self.danger.m, LEAST)
        return np.sqrt(self._calm_cost**2 + self.against**2 * (1.0 - m) / m)

    @cost.setter
    def cost(self, value: ArrayLike) -> None:
        self._calm_cost = checked_cost("EvasiveTask", value, self.robot.nq)

    def compute_error(self, configuration: Any) -> Array:
        """-q̇0 dt, (n,) [rad]."""
        return -updated(self.danger).qd0 * self.danger.dt

    def compute_jacobian(self, configuration: Any) -> Array:
        """Identity over the robot's joints, (n, nv)."""
        return self.joints(configuration).spread(np.eye(self.robot.nq))


class ClikRows(OnRobot):
    """J Δq = (ẋ_d + K e) dt of one of qpsafe's tasks.

    Attributes:
        task: The task.
        time: Where its trajectory is, to be set by the loop [s].
        cost: Of every row, (rows,).
    """

    task: Task
    cost: Array
    dt: float
    time: float

    def set_up(self, task: Task, robot: Robot, dt: float, prefix: str) -> None:
        """Check and keep the arguments of the constructor.

        Args:
            task: One of qpsafe's.
            robot: The robot it is for.
            dt: Tick [s].
            prefix: What stands before the joints' names in the model.
        """
        if not isinstance(task, Task):
            raise ConfigurationError("ClikTask", "task", task, "a Task, e.g. PositionTask")
        misfit = task.misfit(checked_robot("ClikTask", robot))
        if misfit is not None:
            raise ConfigurationError(type(task).__name__, misfit.key, misfit.value, misfit.expected)
        dt = checked_dt("ClikTask", dt)
        if not dt * task.gain < 1.0:
            raise ConfigurationError(type(task).__name__, "gain", task.gain, f"K dt between 0 and 1 with dt = {dt} s")
        self.prefix = checked_prefix("ClikTask", prefix)
        self.task, self.robot, self.dt, self.time = task, robot, dt, 0.0

    def compute_error(self, configuration: Any) -> Array:
        """-(ẋ_d + K e) dt, (rows,)."""
        sample = self.task.trajectory.sample(self.time)
        error = self.task.error(self.task.value(self.at(configuration)), sample)
        return -self.task.velocity(error, sample) * self.dt

    def compute_jacobian(self, configuration: Any) -> Array:
        """The task's Jacobian, (rows, nv)."""
        return self.joints(configuration).spread(self.task.jacobian(self.at(configuration)))


class DangerRows(OnRobot):
    """CDF(q, q̇, p) <= Δ_max as rows G Δq <= h, for the most dangerous points (derivations, section 2).

    CDF = k1 S + k2 H(q̇), H convex and positively homogeneous: its tangent at the present velocity is exact along that
    velocity and never above H, so (with horizon 0) no velocity that meets the cap is cut off. What a tangent lets
    through, `guard` scales down exactly. With a horizon τ, S is predicted: S + τ ∂S/∂q q̇.

    The rows never make a call fail: h is widened until standstill, and what braking within the joint limits leaves of
    it, meet all of them. So a point whose static field alone exceeds the cap gets a row "no nearer".
    """

    danger: DangerMonitor
    barrier: DangerBarrier

    def set_up(self, danger: DangerMonitor, delta_max: float, horizon: float, points: int, prefix: str) -> None:
        """Check and keep the arguments of the constructor.

        Args:
            danger: What is near the robot.
            delta_max: Δ_max.
            horizon: τ [s].
            points: How many of the most dangerous points get a row.
            prefix: What stands before the joints' names in the model.
        """
        self.danger, self.prefix = checked_danger("DangerLimit", danger), checked_prefix("DangerLimit", prefix)
        self.robot = danger.robot
        self.barrier = DangerBarrier(delta_max, horizon, points, danger.field)

    def cap(self) -> DangerBarrier:
        """The cap on the field that the monitor has now."""
        if self.barrier.field is not self.danger.field:
            old = self.barrier
            self.barrier = DangerBarrier(old.delta_max, old.horizon, old.points, self.danger.field)
        return self.barrier

    def rows(self, configuration: Any, dt: float) -> tuple[Array, Array] | None:
        """(G, h) with G Δq <= h, or None where there are no points."""
        danger = same_tick(updated(self.danger), dt, "DangerLimit")
        if danger.state is None:
            return None
        level = self.cap().level(danger.state, danger.qd, danger.points, danger.danger)
        if level is None:
            return None
        room = np.maximum(level.upper, 0.0)
        if danger.box is not None:
            room = np.maximum(room, level.A @ danger.box.clip(np.zeros(self.robot.nq)))
        return self.joints(configuration).spread(level.A), room * dt

    def guard(self, configuration: Any, velocity: ArrayLike) -> Array:
        """The velocity (nv,) scaled down so that CDF <= Δ_max exactly, wherever the static field leaves room for it.

        The acceleration limits come first, if the monitor has limits: braking takes its time. In a tick of bad input
        they are all that is known. A velocity that is not finite, or absurd, is replaced by the robot's braking and
        standstill of all else.

        Args:
            configuration: Of mink or pink.
            velocity: What `solve_ik` answered (nv,) [rad/s].

        Raises:
            ConfigurationError: It is no array of as many numbers as the model has velocities.
        """
        danger, place = updated(self.danger), self.joints(configuration)
        given = velocity
        if not (type(given) is np.ndarray and given.dtype == _FLOAT):
            given = numbers("DangerLimit.guard", "velocity", velocity, f"{place.nv} numbers [rad/s]")
        if given.shape != (place.nv,):
            raise ConfigurationError("DangerLimit.guard", "velocity.shape", given.shape, f"({place.nv},)")
        good = bool((np.abs(given) < ABSURD_STEP / danger.dt).all())  # false for NaN
        guarded = given.copy() if good else np.zeros(place.nv)
        if good and danger.state is not None:
            guarded *= self.cap().scale(danger.state, given[place.v], danger.points).factor
        if danger.box is not None:
            guarded[place.v] = danger.box.clip(guarded[place.v])
        return guarded


class BoxRows(OnRobot):
    """lo dt <= Δq <= hi dt with the box of `JointLimits`: position, velocity and acceleration, never contradictory."""

    danger: DangerMonitor

    def set_up(self, danger: DangerMonitor, prefix: str) -> None:
        """Check and keep the arguments of the constructor."""
        self.danger, self.prefix = checked_danger("JointLimit", danger), checked_prefix("JointLimit", prefix)
        self.robot = danger.robot
        if danger.limits == "off":
            raise ConfigurationError("JointLimit", "danger.limits", "off", "a DangerMonitor with limits")

    def rows(self, configuration: Any, dt: float) -> tuple[Array, Array]:
        """(G, h) with G Δq <= h, two rows a joint."""
        danger = same_tick(updated(self.danger), dt, "JointLimit")
        unit = self.joints(configuration).spread(np.eye(self.robot.nq))
        if danger.box is None:
            raise ConfigurationError("JointLimit", "danger.limits", danger.limits, "limits since its last update")
        return np.vstack((unit, -unit)), np.concatenate((danger.box.upper, -danger.box.lower)) * dt


class TickRows:
    """No rows: only a check of the tick, which `solve_ik` tells limits and not tasks."""

    parts: tuple[DangerMonitor | ClikRows, ...]

    def set_up(self, parts: tuple[DangerMonitor | ClikRows, ...]) -> None:
        """Check and keep the arguments of the constructor."""
        if not (parts and all(isinstance(part, DangerMonitor | ClikRows) for part in parts)):
            raise ConfigurationError("SameTick", "parts", parts, "DangerMonitors and ClikTasks, at least one")
        self.parts = parts

    def check(self, dt: float) -> None:
        """Refuse another tick [s] than the parts'."""
        for part in self.parts:
            check_tick(part, dt, "SameTick")


class ReleasableRows:
    """A task of theirs that danger releases: it stands in a call of `solve_ik`, and is no task to convert."""

    task: Any
    danger: DangerMonitor
    priority: int

    def set_up(self, task: Any, danger: DangerMonitor, priority: int) -> None:
        """Check and keep the arguments of the constructor.

        Args:
            task: One of theirs.
            danger: What is near the robot.
            priority: From 2.
        """
        self.task, self.danger, self.priority = task, danger, checked_priority(danger, priority)

    def release(self) -> float:
        """a_k / a_1 = f ... of the task of priority k: how much of its weight is left against the first."""
        return math.prod(updated(self.danger).switches[1 : self.priority])
