"""How a task comes back to its path: the rules, and the joint limits on the way."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.limits import JointLimits
from qpsafe.text.given import number

#: Between these times, speeds and lengths can be computed with.
LEAST, MOST = 1e-100, 1e100


@dataclass(frozen=True)
class RecoveryRules:
    """How the robot returns to its path, and when it counts as returned.

    Attributes:
        speed, angular_speed, joint_speed: Peak speed of a return from rest [m/s], [rad/s], [rad/s]; what is left of the
            evasive motion runs out on top of it.
        shortest: Least duration of a return [s], so that small ones stay gentle.
        fade: Time constant with which a task's motion runs out while it may not return or is faster than a return [s].
        acceleration: Share of the joints' acceleration limits that is used on the way back, in (0, 1]; more only
            where a joint could not otherwise stop before its position limit.
        tolerance: Largest error norm at which a task counts as met [m or rad].
        ramp: Time in which the path's clock comes to full speed again, or to rest when it is paused [s].
        patience: Time [s] after which a robot that stands off its goals, or moves without getting nearer, though no
            danger and no motion of the goals explains it, says so, and is led back through its joints or held.
        calm, dwell: The way back begins when danger has been at or below this share of Δ(1-ε) for this time [s]. Until
            then, where danger is not above Δ(1-ε), the tasks are held where they are.
        held: Whether they are held above it, too. In the paper what is left of their activation pulls them to x_d,s.
        enabled: False to compare: the path goes on whatever happens, and CLIK alone pulls the robot back.

    Raises:
        ConfigurationError: A value is not a finite number > 0 (`dwell` may be 0), or a share is more than 1.
    """

    speed: float = 0.5
    angular_speed: float = 1.6
    joint_speed: float = 0.8
    shortest: float = 0.4
    fade: float = 0.1
    acceleration: float = 0.5
    tolerance: float = 5e-4
    ramp: float = 0.2
    patience: float = 2.0
    calm: float = 0.8
    dwell: float = 0.1
    held: bool = True
    enabled: bool = True

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if item.type == "bool":
                if not isinstance(value, bool):
                    raise ConfigurationError("RecoveryRules", item.name, value, "True or False")
            elif item.name == "dwell":
                expected = f"a finite number >= 0, up to {MOST:g}"
                value = number("RecoveryRules", item.name, value, expected, 0.0, most=MOST)
            else:
                expected = f"a finite number > 0, from {LEAST:g} to {MOST:g}"
                value = number("RecoveryRules", item.name, value, expected, LEAST, most=MOST)
            object.__setattr__(self, item.name, value)
        for key in ("acceleration", "calm"):
            if getattr(self, key) > 1.0:
                raise ConfigurationError("RecoveryRules", key, getattr(self, key), "a share in (0, 1]")

    @classmethod
    def paper(cls) -> RecoveryRules:
        """The way back begins as soon as danger falls below Δ(1-ε), section IV-C, at the pace of the first release."""
        return cls(speed=0.25, angular_speed=0.8, calm=1.0, dwell=0.0, held=False)


class GentleLimits:
    """Joint limits of the way back: a share of the acceleration, as long as the other limits can be met with it.

    Args:
        share: Of the acceleration limits.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self._made: tuple[JointLimits, JointLimits] | None = None

    def choose(
        self, limits: JointLimits, q: NDArray[np.float64], qd: NDArray[np.float64], qdd: NDArray[np.float64]
    ) -> JointLimits:
        """The limits of a tick on the way back; `limits` themselves where a joint has to be braked harder.

        Args:
            limits: The robot's.
            q, qd, qdd: Commanded joint position, velocity and acceleration (n,) [rad, rad/s, rad/s²].
        """
        if type(limits) is not JointLimits:  # somebody's own
            return limits
        if self._made is None or self._made[0] is not limits:
            self._made = limits, limits.gentler(self._share)
        gentle = self._made[1]
        return limits if any(gentle.box(q, qd, qdd).sacrificed.tolist()) else gentle
