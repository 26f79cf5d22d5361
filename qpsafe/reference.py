"""What the industrial controller is given at every tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class JointReference:
    """Joint references of one tick, arm side, SI.

    Attributes:
        seq: Number of the tick, counting from 0.
        time: seq * dt [s].
        q: Position reference (n,) [rad], finite and within limits.
        qd: Velocity reference (n,) [rad/s]; `q` is the last `q` plus `qd` dt.
        active: False until a first valid measurement told where the robot is: do not move on such a reference.
    """

    seq: int
    time: float
    q: NDArray[np.float64]
    qd: NDArray[np.float64]
    active: bool = True
