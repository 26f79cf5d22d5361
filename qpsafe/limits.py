"""Joint limits that can always be met: one box lower <= q̇ <= upper per tick (derivations, section 4).

The box is the intersection of velocity limits, acceleration limits around the last command, and the largest speeds
from which braking by at most a dt per tick still stops before the position limits. Whoever stays inside the box finds
it non-empty at the next tick, so a law that respects it never meets an infeasible problem.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled.compiled import entry, inline, readable
from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.robot.own_limits import check_slides
from qpsafe.text.given import number, numbers
from qpsafe.text.words import call

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

#: A shorter tick is meant in other units, and leaves nothing to compute with [s].
SHORTEST_TICK = 1e-6
#: Between these rates can be computed with.
LEAST, MOST = 1e-100, 1e100
#: Kinds of limits by their code; 0 stands for none.
KINDS = ("", "position", "velocity", "acceleration", "jerk", "stillness")
JERK = KINDS.index("jerk")


class Box(NamedTuple):
    """Admissible joint velocities of one tick.

    Attributes:
        lower: (n,) [rad/s].
        upper: (n,) [rad/s], >= lower.
        lower_kind: Which limit made `lower`, (n,) codes into `KINDS`.
        upper_kind: Which limit made `upper`, (n,) codes into `KINDS`.
        sacrificed: Which limit had to give way to the others, (n,) codes into `KINDS`, 0 for none. Jerk, where it is
            limited, gives way first, then position, then velocity; acceleration always holds. The gravest is named.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    lower_kind: NDArray[np.int64]
    upper_kind: NDArray[np.int64]
    sacrificed: NDArray[np.int64]

    def __repr__(self) -> str:
        return call(self, self.lower, self.upper)

    def clip(self, qd: NDArray[np.float64]) -> NDArray[np.float64]:
        """The nearest velocity inside the box; `qd` must be finite."""
        return np.minimum(np.maximum(qd, self.lower), self.upper)

    def admit(self, qd: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """The nearest velocity inside the box, and by how much `qd` was outside, at most; NaN if a limit gave way."""
        admitted = np.empty(len(qd))
        return admitted, _admit(qd, self.lower, self.upper, self.sacrificed, admitted)

    def binding(self, qd: NDArray[np.float64], names: tuple[str, ...], tolerance: float = 1e-9) -> tuple[str, ...]:
        """Limits that `qd` (n,) touches, e.g. ``"joint_2: upper acceleration"``.

        Args:
            qd: (n,) [rad/s].
            names: Of the joints.
            tolerance: What counts as touching [rad/s].
        """
        found = []
        for i, name in enumerate(names):
            if qd[i] >= self.upper[i] - tolerance:
                found.append(f"{name}: upper {KINDS[self.upper_kind[i]]}")
            elif qd[i] <= self.lower[i] + tolerance:
                found.append(f"{name}: lower {KINDS[self.lower_kind[i]]}")
        return tuple(found)

    def notes(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """What was sacrificed, in words, one entry per joint concerned."""
        return tuple(f"{names[i]}: {KINDS[kind]} limit sacrificed" for i, kind in enumerate(self.sacrificed) if kind)


class JointLimits(Fixed):
    """Position, velocity and acceleration limits of a velocity-controlled robot sampled at `dt`.

    Args:
        lower: Lowest joint positions (n,) [rad], may be -inf.
        upper: Highest joint positions (n,) [rad], may be +inf.
        max_velocity: (n,) [rad/s], > 0.
        max_acceleration: (n,) [rad/s²], > 0.
        dt: Sample time [s].
        return_speed: Speed at which a joint that starts outside its position limits is brought back [rad/s].
        max_jerk: (n,) [rad/s³], > 0, or None. Smooths the motion; it is no hard limit, since braking in time for the
            others comes first.

    Raises:
        ConfigurationError: Shapes differ, a number is NaN, lower > upper, a rate is not positive, or one is changed.
    """

    fixed = frozenset(("lower", "upper", "max_velocity", "max_acceleration", "dt", "return_speed", "max_jerk", "table"))

    def __init__(
        self,
        lower: ArrayLike,
        upper: ArrayLike,
        max_velocity: ArrayLike,
        max_acceleration: ArrayLike,
        dt: float = 0.004,
        return_speed: float = 0.1,
        max_jerk: ArrayLike | None = None,
    ) -> None:
        self.lower, self.upper = _per_joint("lower", lower), _per_joint("upper", upper)
        self.max_velocity = _per_joint("max_velocity", max_velocity)
        self.max_acceleration = _per_joint("max_acceleration", max_acceleration)
        self.dt = number("JointLimits", "dt", dt, f"finite and > 0, from {SHORTEST_TICK:g} s", SHORTEST_TICK)
        expected = f"finite and > 0, from {LEAST:g} to {MOST:g}"
        self.return_speed = number("JointLimits", "return_speed", return_speed, expected, LEAST, most=MOST)
        self.max_jerk = None if max_jerk is None else _per_joint("max_jerk", max_jerk)
        shape = self.lower.shape
        rates = ("max_velocity", "max_acceleration") + (() if max_jerk is None else ("max_jerk",))
        for key in ("upper", *rates):
            if getattr(self, key).shape != shape:
                raise ConfigurationError("JointLimits", key, getattr(self, key), f"an array of shape {shape}")
        if not (self.lower <= self.upper).all():
            raise ConfigurationError("JointLimits", "lower", self.lower, f"numbers <= upper = {self.upper}")
        for key in rates:
            value = getattr(self, key)
            if not ((value >= LEAST) & (value <= MOST)).all():  # false for NaN
                raise ConfigurationError("JointLimits", key, value, expected)

        self.table = np.array((self.lower, self.upper, self.max_velocity, self.max_acceleration))  # for compiled code

    def __repr__(self) -> str:
        return call(self, max_velocity=self.max_velocity, max_acceleration=self.max_acceleration, dt=self.dt)

    @classmethod
    def of(cls, robot: Robot, dt: float = 0.004) -> JointLimits:
        """The robot's own limits, sampled at dt [s]."""
        return cls(robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, dt)

    def plain(self) -> JointLimits:
        """The same numbers as plain `JointLimits`."""
        return self if type(self) is JointLimits else JointLimits.gentler(self, 1.0)

    def gentler(self, share: float) -> JointLimits:
        """The same limits with a share of the acceleration."""
        acceleration = share * self.max_acceleration
        rest = self.dt, self.return_speed, self.max_jerk
        return JointLimits(self.lower, self.upper, self.max_velocity, acceleration, *rest)

    def box(self, q: NDArray[np.float64], qd: NDArray[np.float64], qdd: NDArray[np.float64] | None = None) -> Box:
        """Admissible velocities for the next tick.

        Args:
            q: Commanded joint position (n,) [rad], finite.
            qd: Last commanded joint velocity (n,) [rad/s], finite.
            qdd: Acceleration that led to it (n,) [rad/s²], for the jerk limit; 0 if None.

        Returns:
            A box with lower <= upper, whatever the state.
        """
        bounds = np.empty((2, len(q)))
        kinds = np.empty((3, len(q)), dtype=np.int64)
        limits = (self.lower, self.upper, self.max_velocity, self.max_acceleration)
        _box(q, qd, *limits, self.dt, self.return_speed, bounds, kinds)
        if self.max_jerk is not None:
            _limit_jerk(qd, np.zeros_like(qd) if qdd is None else qdd, self.max_jerk, self.dt, bounds, kinds)
        return Box(*bounds, *kinds)


def checked_limits(where: str, limits: JointLimits | str | None, robot: Robot, dt: float) -> JointLimits | None:
    """`limits`, if they fit the robot and the tick; the robot's own for None or "robot"; None for "off".

    Args:
        where: Who asks, for the error.
        limits: As given.
        robot: Whose joints these are.
        dt: Tick [s].

    Raises:
        ConfigurationError: They do not fit, or let a joint slide too far; the error names `where`.
    """
    if limits is None or (isinstance(limits, str) and limits == "robot"):
        return JointLimits.of(robot, dt)
    if isinstance(limits, str) and limits == "off":
        return None
    if not isinstance(limits, JointLimits):
        raise ConfigurationError(where, "limits", limits, 'a JointLimits, "robot" or "off"')
    if limits.lower.shape != (robot.nq,):
        raise ConfigurationError(where, "limits", f"limits of shape {limits.lower.shape}", f"({robot.nq},)")
    if limits.dt != dt:
        raise ConfigurationError(where, "limits.dt", limits.dt, f"the controller's tick, dt = {dt} s")
    check_slides(where, limits, robot)
    return limits


def _per_joint(key: str, value: ArrayLike) -> NDArray[np.float64]:
    return numbers("JointLimits", key, value, "one number a joint", ndim=1)


@entry(types.float64(types.float64, types.float64, types.float64))
def stopping_speed(s: float, a: float, dt: float) -> float:
    """Largest speed that, reduced by a dt each tick, has stopped after at most the distance s >= 0.

    With n = s/(a dt²) and k = floor((sqrt(1+8n)-1)/2) full decrements: v = a dt (n + k(k+1)/2)/(k+1), since the way
    covered, dt Σ_{j=0..k} (v - j a dt), must equal s.
    """
    n = s / (a * dt * dt)
    if not n < 1e15:  # infinitely far away
        return np.inf
    k = math.floor((math.sqrt(1.0 + 8.0 * n) - 1.0) / 2.0)
    return a * dt * (n + 0.5 * k * (k + 1.0)) / (k + 1.0)


@inline
def _position_bound(s, a, dt, return_speed):  # type: ignore[no-untyped-def]
    """Highest speed towards a position limit at distance s; negative, i.e. away from it, where it was passed."""
    if s >= 0.0:
        return stopping_speed(s, a, dt)
    return -min(-s / dt, return_speed)


_read, _bounds, _kinds = readable(1), types.float64[:, ::1], types.int64[:, ::1]


@inline
def box_into(q, qd, lower, upper, v_max, a_max, dt, return_speed, bounds, kinds):  # type: ignore[no-untyped-def]
    """Fill bounds (2, n) with lower and upper speeds, kinds (3, n) with the codes of Box; one joint at a time."""
    for i in range(len(q)):
        a = a_max[i]
        lo, hi = qd[i] - a * dt, qd[i] + a * dt
        kind_lo, kind_hi, sacrificed = 3, 3, 0
        if lo > v_max[i]:  # too fast to be under the velocity limit after one tick: brake as hard as allowed
            hi, sacrificed = lo, 2
        elif hi < -v_max[i]:
            lo, sacrificed = hi, 2
        else:
            if -v_max[i] > lo:
                lo, kind_lo = -v_max[i], 2
            if v_max[i] < hi:
                hi, kind_hi = v_max[i], 2
        p_hi = _position_bound(upper[i] - q[i], a, dt, return_speed)
        p_lo = -_position_bound(q[i] - lower[i], a, dt, return_speed)
        # where the position bound is out of reach, the nearest speed that is not (1e-9: rounding is no sacrifice)
        if p_hi < lo - 1e-9 or p_lo > hi + 1e-9 or q[i] < lower[i] - 1e-9 or q[i] > upper[i] + 1e-9:
            sacrificed = max(sacrificed, 1)
        old_lo, old_hi = lo, hi
        if p_hi < hi:
            hi, kind_hi = max(p_hi, old_lo), 1
        if p_lo > lo:
            lo, kind_lo = min(p_lo, old_hi), 1
        if lo > hi:  # position limits closer together than the robot can obey: the middle
            lo = hi = 0.5 * (lo + hi)
            sacrificed = max(sacrificed, 1)
        bounds[0, i], bounds[1, i] = lo, hi
        kinds[0, i], kinds[1, i], kinds[2, i] = kind_lo, kind_hi, sacrificed


@entry(types.void(*[_read] * 6, types.float64, types.float64, _bounds, _kinds))
def _box(q, qd, lower, upper, v_max, a_max, dt, return_speed, bounds, kinds):  # type: ignore[no-untyped-def]
    box_into(q, qd, lower, upper, v_max, a_max, dt, return_speed, bounds, kinds)


@inline
def admit_into(qd, lower, upper, sacrificed, admitted):  # type: ignore[no-untyped-def]
    """Clip qd to the box; returns by how much it was outside, at most; NaN if a limit gave way."""
    excess = 0.0
    for i in range(len(qd)):
        admitted[i] = min(max(qd[i], lower[i]), upper[i])
        excess += np.nan if sacrificed[i] else 0.0
        excess = max(abs(admitted[i] - qd[i]), excess) if excess == excess else excess
    return excess


@entry(types.float64(_read, _read, _read, types.Array(types.int64, 1, "A", readonly=True), types.float64[::1]))
def _admit(qd, lower, upper, sacrificed, admitted):  # type: ignore[no-untyped-def]
    return admit_into(qd, lower, upper, sacrificed, admitted)


@entry(types.void(*[_read] * 3, types.float64, _bounds, _kinds))
def _limit_jerk(qd, qdd, jerk, dt, bounds, kinds):  # type: ignore[no-untyped-def]
    """Narrow the box to |q̈ - q̈_last| <= jerk dt where that leaves something, else to its nearest point."""
    for i in range(len(qd)):
        low, high = qd[i] + (qdd[i] - jerk[i] * dt) * dt, qd[i] + (qdd[i] + jerk[i] * dt) * dt
        if low > bounds[1, i]:
            bounds[0, i] = bounds[1, i]
        elif high < bounds[0, i]:
            bounds[1, i] = bounds[0, i]
        else:
            if low > bounds[0, i]:
                bounds[0, i], kinds[0, i] = low, 4
            if high < bounds[1, i]:
                bounds[1, i], kinds[1, i] = high, 4
            continue
        if kinds[2, i] == 0:
            kinds[2, i] = 4
