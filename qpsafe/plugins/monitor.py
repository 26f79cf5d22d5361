"""What the plug-ins of one robot share in a tick: detected points, danger, evasive velocity, admissible speeds."""

from __future__ import annotations

import copy
import math
from contextlib import suppress
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.activation import Activation
from qpsafe.danger.evasion import Evasion, evade, link_vectors, virtual_torque
from qpsafe.danger.field import DangerField, danger_vectors
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.errors import ConfigurationError
from qpsafe.limits import Box, JointLimits, checked_limits
from qpsafe.pipeline.checks import checked_dt, checked_evasion, checked_field, checked_robot, own_evasion
from qpsafe.pipeline.sense import CLOUD
from qpsafe.ranging.reduction.cloud import check_size, reduced, reduction
from qpsafe.robot.robot import Robot
from qpsafe.robot.state import RobotState
from qpsafe.robot.wire import Wire
from qpsafe.sensing.detection import (
    BadInput,
    as_joint_position,
    as_joint_velocity,
    as_points,
    find_nearest,
    refuse_points,
)
from qpsafe.tasks.trajectory import checked_pose
from qpsafe.text.given import number
from qpsafe.tick import BAD_INPUT, OK

Array = NDArray[np.float64]


class DangerMonitor:
    """Danger of the detected points, eqs. (1)-(8), and the evasive velocity, (14)-(16): `update` it once a tick.

    It does what `SafetyController.step` does before its law, for a loop that has a law of its own. `field`,
    `activation`, `evasion`, `limits` and `ramp` may be exchanged, by assignment, between two ticks.

    Args:
        robot: The robot whose wire makes the field.
        dt: Tick [s], the same as given to `solve_ik`.
        field: The danger field; the paper's weights by default.
        activation: Thresholds, the highest priority's first; the robot's two by default.
        evasion: The admittance (16); that of the robot by default, "paper" for M = 4, D = 20.
        limits: Joint limits, by default the robot's; "off" for none.
        ramp: A task that danger released comes back within this time at the earliest, and is released within a tenth
            of it [s]; 0 for at once. Here no path waits for the robot, as in section IV-C.
        base: Where the robot stands in the world of the points, a pose (4, 4); at the origin by default.

    Attributes:
        state: The robot as last measured, None if that was no usable measurement.
        qd: Its joint velocity (n,) [rad/s].
        points: Detected points (p, 3), in the robot's own world frame [m].
        danger: CDF at the points (p,).
        cdf_n: Largest of them, 0 without points; NaN where the input was bad.
        switches: (m, f, ...) of eqs. (19), (21), smoothed by `ramp`; all 0 where the input was bad: the robot brakes.
        qd0: Evasive velocity (n,) [rad/s].
        box: Joint velocities that the limits admit, after bad input only braking; None without limits.
        status: ``"ok"`` or ``"bad_input"``.
        message: What was wrong with the input, or that there were too many points; else empty.

    Raises:
        ConfigurationError: Names the argument that is wrong.
    """

    def __init__(
        self,
        robot: Robot,
        dt: float = 0.004,
        *,
        field: DangerField | None = None,
        activation: Activation | None = None,
        evasion: Evasion | str | None = None,
        limits: JointLimits | str | None = None,
        ramp: float = 0.5,
        base: ArrayLike | None = None,
    ) -> None:
        self._robot, self._dt = checked_robot("DangerMonitor", robot), checked_dt("DangerMonitor", dt)
        self._base = None if base is None else checked_pose("DangerMonitor", "base", base)
        self._count = 0  # of switches; 0 until they are known
        self.ramp, self.field = ramp, DangerField() if field is None else field
        self.activation = Activation(robot_thresholds(robot)) if activation is None else activation
        self._evasion = checked_evasion(evasion, self._robot, self._dt, "DangerMonitor")  # its own since `reset`
        self.limits = limits
        self._within = (np.zeros(robot.nq),) * 2  # lowest and highest velocity that it may have been sent last
        self.reset()

    @property
    def robot(self) -> Robot:
        """The robot, given for good."""
        return self._robot

    @property
    def dt(self) -> float:
        """Tick [s], given for good."""
        return self._dt

    @property
    def ramp(self) -> float:
        """Within this time at the earliest a released task comes back [s]."""
        return self._ramp

    @ramp.setter
    def ramp(self, ramp: float) -> None:
        self._ramp = number("DangerMonitor", "ramp", ramp, "a finite time >= 0 [s]", 0.0)

    @property
    def field(self) -> Any:
        """The danger field."""
        return self._field

    @field.setter
    def field(self, field: Any) -> None:
        self._field = checked_field(field, "DangerMonitor")

    @property
    def activation(self) -> Activation:
        """Thresholds; another one has as many switches, which tasks were made for."""
        return self._activation

    @activation.setter
    def activation(self, activation: Activation) -> None:
        if not isinstance(activation, Activation):
            raise ConfigurationError("DangerMonitor", "activation", activation, "an Activation")
        if self._count not in (0, len(activation.levels)):
            expected = f"an Activation with as many switches as before, {self._count}"
            raise ConfigurationError("DangerMonitor", "activation", activation, expected)
        self._activation, self._count = activation, len(activation.levels)

    @property
    def evasion(self) -> Evasion:
        """The admittance (16); its velocity is remembered in it."""
        return self._evasion

    @evasion.setter
    def evasion(self, evasion: Evasion | str | None) -> None:
        self._evasion = own_evasion(self, checked_evasion(evasion, self._robot, self._dt, "DangerMonitor"))

    @property
    def limits(self) -> JointLimits | Literal["off"]:
        """Joint limits, from the next update on."""
        return "off" if self._limits is None else self._limits

    @limits.setter
    def limits(self, limits: JointLimits | str | None) -> None:
        self._limits = checked_limits("DangerMonitor", limits, self._robot, self._dt)

    def __copy__(self) -> Self:
        """One of its own that goes on from here; parts that do not change are shared."""
        return copy.deepcopy(self, {id(part): part for part in (self._robot, self._field, self._activation)})

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy has an evasion of its own."""
        self.__dict__.update(state)
        own_evasion(self, self._evasion)

    def reset(self) -> None:
        """Forget what was near: no points, no evasive velocity. From its last velocity the robot has to brake still."""
        own_evasion(self, self._evasion).reset()
        self.ticks, within = 0, self._within
        self._bad("not updated yet")
        self._within = within
        self.status, self.message = OK, ""
        self._last = (1.0,) * len(self.switches)

    @property
    def m(self) -> float:
        """Switch (19) of the task of highest priority."""
        return self.switches[0]

    def update(self, q: ArrayLike, qd: ArrayLike, points: ArrayLike) -> None:
        """Take in one tick. Never raises on data: bad input is reported in `status`, and the robot brakes.

        Args:
            q: Joint position (n,) [rad].
            qd: Joint velocity (n,) [rad/s], e.g. what the last `solve_ik` returned.
            points: Detected points (p, 3) [m]; an empty list where nothing is in sight. More than 1,000 are reduced to
                those nearest to the links, which `message` says; more than 20,000 are bad input.
        """
        self.ticks += 1
        try:
            self._take(q, qd, points)
        except BadInput as problem:
            with suppress(BadInput):  # without a velocity it is within what the limits last admitted
                self._within = (as_joint_velocity(qd, self.robot),) * 2
            self._bad(str(problem))
            self.qd0 = self.evasion.step(np.zeros(self.robot.nq)).copy()  # what was known fades

    def _take(self, q: ArrayLike, qd: ArrayLike, points: ArrayLike) -> None:
        q, qd = as_joint_position(q, self.robot), as_joint_velocity(qd, self.robot)
        state = self.robot.at(q)
        wire = state.wire(qd)
        points, message = self._own(as_points(points), wire)
        links = np.empty(len(points), dtype=np.int64)
        if not find_nearest(points, wire.starts, wire.ends, links):
            refuse_points(points)
        danger, gradient = self.field.evaluate(points, wire)  # (5)
        vectors = danger_vectors(danger, gradient)  # (6)
        forces = link_vectors(vectors, links, len(self.robot.wire_frames))  # (8)
        torque = virtual_torque(state, forces)  # (14), (15)
        if not (np.isfinite(danger).all() and np.isfinite(torque).all()):
            raise BadInput("the danger of a detected point is not finite: joint values or points are out of all bounds")
        self.state: RobotState | None = state
        self.qd, self.points, self.danger = qd, points, danger
        self.cdf_n = float(danger.max(initial=0.0))
        self.switches = self._ramped(self.activation.switches(self.cdf_n))  # (19), (21)
        coming = math.inf if len(points) else 0.0  # nobody says how fast points move
        self.qd0 = evade(self.evasion, torque, coming).copy()  # (16)
        self.box: Box | None = None if self._limits is None else self._limits.box(q, qd)
        self._within = (qd, qd) if self.box is None else (self.box.lower, self.box.upper)
        self.status, self.message = OK, message

    def _own(self, points: Array, wire: Wire) -> tuple[Array, str]:
        """Points as seen from the base, copied; clouds reduced as `SafetyController.step` does, and what is said then.

        Args:
            points: In the world (p, 3) [m].
            wire: Of the robot now.
        """
        given = len(points)
        if given > CLOUD:
            check_size(points)
        if self._base is None:
            points = points.copy()
        else:
            with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is refused by who comes next
                points = (points - self._base[:3, 3]) @ self._base[:3, :3]
        if given <= CLOUD:
            return points, ""
        points = reduced(points, wire)
        return points, reduction(given, len(points))

    def _ramped(self, switches: tuple[float, ...]) -> tuple[float, ...]:
        """Fall within a few ticks, with the time constant ramp / 25; rise by at most dt / ramp.

        A tool that turns back raises its own danger: speed, danger and switch form a loop without any delay, which
        chatters if the switch answers in full at once.
        """
        if self.ramp > 0.0:
            rise, fall = self.dt / self.ramp, self.dt / (self.dt + self.ramp / 25.0)
            pairs = zip(switches, self._last, strict=True)
            switches = tuple(min(now, last + rise) if now > last else last + fall * (now - last) for now, last in pairs)
        self._last = switches
        return switches

    def _bad(self, message: str) -> None:
        n = self.robot.nq
        self.state, self.qd, self.qd0 = None, np.zeros(n), np.zeros(n)
        self.points, self.danger, self.cdf_n = np.empty((0, 3)), np.empty(0), math.nan
        self.switches = self._last = (0.0,) * len(self.activation.levels)
        self.box = None if self._limits is None else self._braking(self._limits.max_acceleration * self.dt)
        self.status, self.message = BAD_INPUT, message

    def _braking(self, most: Array) -> Box:
        """As near to rest as `most` (n,) allows in one tick, from whatever velocity the robot may have been sent last.

        What a box admits is at most two such steps wide: one velocity is within a step of all of it.
        """
        lower, upper = self._within
        slowest = np.minimum(np.maximum(0.0, upper - most), lower + most)
        self._within = slowest, slowest
        no_kind = np.zeros(len(slowest), dtype=np.int64)
        return Box(slowest, slowest.copy(), no_kind, no_kind, no_kind)
