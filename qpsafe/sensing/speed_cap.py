"""The reduced speed of a robot that does not see all around it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.limits import Box
    from qpsafe.robot.state import RobotState


def wire_speed(qd: NDArray[np.float64], state: RobotState) -> float:
    """Largest speed of any end of the robot's wire, and so of any of its points [m/s]."""
    velocities = state.wire_jacobians() @ qd  # (k, 3); linear along a link, so largest at an end
    return float(np.sqrt(np.max(np.sum(velocities**2, axis=1))))


def slowed(qd: NDArray[np.float64], state: RobotState, cap: float, box: Box | None) -> NDArray[np.float64]:
    """The velocity qd (n,) [rad/s], scaled so that no point of the wire is faster than `cap` [m/s].

    The direction of the motion is kept. A robot that is faster now brakes as hard as the box of its limits allows.

    Args:
        qd: As wished (n,) [rad/s].
        state: Where the robot is.
        cap: [m/s].
        box: Of the limits; None without.
    """
    speed = wire_speed(qd, state)
    if speed <= cap:
        return qd
    scaled = qd * (cap / speed)
    return scaled if box is None else box.clip(scaled)
