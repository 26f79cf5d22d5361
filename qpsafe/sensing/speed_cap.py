"""The reduced speed of a robot that does not see all around it."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, entry, inline, readable

if TYPE_CHECKING:
    from qpsafe.limits import Box
    from qpsafe.robot.state import RobotState


@inline
def fastest(qd: Array, jacobians: Array) -> float:
    """Largest speed of points with linear Jacobians (k, 3, n)."""
    most = 0.0
    for i in range(jacobians.shape[0]):
        square = 0.0
        for c in range(3):
            v = 0.0
            for j in range(qd.shape[0]):
                v += jacobians[i, c, j] * qd[j]
            square += v * v
        most = max(most, square)
    return sqrt(most)


@entry(types.float64(readable(1), types.Array(types.float64, 3, "C", readonly=True)))
def _fastest(qd: Array, jacobians: Array) -> float:
    return fastest(qd, jacobians)


def wire_speed(qd: NDArray[np.float64], state: RobotState) -> float:
    """Largest speed of any end of the robot's wire, and so of any of its points [m/s].

    The speed is linear along a link, so it is largest at an end.
    """
    return _fastest(qd, state.wire_jacobians())


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
