"""How near a path comes to the joints' limits: of position, speed and acceleration, joint by joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.check.path import NominalPath
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

TOUCHING = 1e-4  # a margin of less than that is none [rad]


class JointMargin(NamedTuple):
    """What a path leaves of one joint's limits.

    Attributes:
        name: The joint's.
        position: Smallest distance to a limit [rad, or m where it slides]; +inf where it turns without end.
        position_time: When [s].
        velocity: Largest share of the joint's speed, 1 at the limit.
        velocity_time: When [s].
        acceleration: Largest share of its acceleration.
        acceleration_time: When [s].
    """

    name: str
    position: float
    position_time: float
    velocity: float
    velocity_time: float
    acceleration: float
    acceleration_time: float

    @property
    def good(self) -> bool:
        """Whether the path stays off the position's limits, and within the others."""
        return self.position > TOUCHING and self.velocity <= 1.0 and self.acceleration <= 1.0


def position_margins(robot: Robot, path: NominalPath) -> Array:
    """Distance of every joint to its nearer limit, (N, n) [rad]; +inf where it turns without end."""
    margins = np.minimum(path.q - robot.lower, robot.upper - path.q)
    return np.where(robot.endless, np.inf, margins)


def joint_margins(robot: Robot, path: NominalPath) -> tuple[JointMargin, ...]:
    """Margins of every joint; none for a path without a moment."""
    if not len(path.times):
        return ()
    nearest = position_margins(robot, path)
    shares = np.abs(path.qd) / robot.max_velocity, np.abs(path.qdd) / robot.max_acceleration
    at = nearest.argmin(axis=0), shares[0].argmax(axis=0), shares[1].argmax(axis=0)
    found = []
    for j, name in enumerate(robot.joint_names):
        values = [float(table[k[j], j]) for table, k in zip((nearest, *shares), at, strict=True)]
        when = [float(path.times[k[j]]) for k in at]
        found.append(JointMargin(name, values[0], when[0], values[1], when[1], values[2], when[2]))
    return tuple(found)
