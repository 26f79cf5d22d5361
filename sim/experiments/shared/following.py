"""Whether the measured robot is where it was commanded to be: promises about commands are worth nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.sim.recording.log import RunLog

LATE = 0.2  # a plant lags by 0.1 s at most, and its servo has settled 0.1 s later [s]
#: The servo is off by its commanded acceleration over omega squared, 30 rad/s² over (100 rad/s)² at most: 0.003. One
#: that is farther off is held back, or has not the torque [rad, m].
OFF = 0.01


def farthest_off(log: RunLog) -> tuple[float, int]:
    """How far a joint was at most from where it was commanded to be in the last `LATE` seconds, and which joint.

    A servo with lag is behind on the way that was commanded, and not beside it: what is looked at is how far a joint
    has left the range of its own commands.

    Args:
        log: A run.

    Returns:
        The largest distance of all joints and ticks [rad, m], and the joint's number.
    """
    window = round(LATE / log.dt)
    start = np.repeat(log.q[:1], window, axis=0)  # before the run it was commanded to stay
    told = sliding_window_view(np.concatenate((start, log.q_ref)), window + 1, axis=0)
    off: NDArray[np.float64] = np.maximum(log.q - told.max(axis=2), told.min(axis=2) - log.q).max(axis=0)
    joint = int(off.argmax())
    return max(float(off[joint]), 0.0), joint
