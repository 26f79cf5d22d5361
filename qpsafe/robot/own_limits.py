"""Joint limits beyond a robot's own: what its geometry was reckoned for ends there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


class Positions(Protocol):
    """What is asked of limits, see `qpsafe.limits.JointLimits`."""

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]


_ROUNDING = 1e-9  # [rad, m]


def check_slides(where: str, limits: Positions, robot: Robot) -> None:
    """Refuse limits that let a joint slide beyond the robot's own.

    How fast links can move for a speed of the joints before it grows with how far that one slides out. Neither the
    gate nor rows that keep clear would hold.

    Args:
        where: Who asks, for the error.
        limits: One number a joint.
        robot: Whose joints these are.

    Raises:
        ConfigurationError: They do.
    """
    for key, own, sign, expected in (("lower", robot.lower, -1.0, ">="), ("upper", robot.upper, 1.0, "<=")):
        given = getattr(limits, key)
        for j in np.flatnonzero(robot.sliding & (sign * (given - own) > _ROUNDING)).tolist():
            value = f"{given[j]:.6g} m of {robot.joint_names[j]}"
            raise ConfigurationError(where, f"limits.{key}", value, f"{expected} the robot's own, {own[j]:.6g} m")


def beyond_own(limits: Positions, robot: Robot) -> tuple[str, ...]:
    """Which joints may turn beyond the robot's own limits, in words; none: ()."""
    beyond = (robot.lower - limits.lower > _ROUNDING) | (limits.upper - robot.upper > _ROUNDING)
    names = [robot.joint_names[j] for j in np.flatnonzero(beyond & ~robot.endless).tolist()]
    if not names:
        return ()
    return (f"limits go beyond the robot's own, of {', '.join(names)}: which of its links never meet was reckoned for "
            "its own; are they in radians?",)  # fmt: skip
