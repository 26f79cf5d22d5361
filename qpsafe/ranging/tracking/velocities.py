"""How fast what one sensor sees moves, its own motion on a robot taken into account."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.tracking.tracks import PointTracks, sweep

Array = NDArray[np.float64]

MOST = 96  # points of an image that are tracked


_ASIDE = np.zeros(1)  # a sensor that stands still


class Velocities:
    """Velocities of what one sensor sees.

    Args:
        sigma: Of its readings [m].
    """

    def __init__(self, sigma: float) -> None:
        self._tracks, self._sigma = PointTracks(most=MOST), np.array([sigma], dtype=np.float64)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._tracks.reset()
        self._pose: Array | None = None
        self._stamp = 0.0

    def __call__(self, stamp: float, points: Array, pose: Array | None) -> Array:
        """Velocities (p, 3) [m/s], zero where none is known.

        Args:
            stamp: Of the image [s].
            points: That it shows (p, 3) [m].
            pose: Of a sensor that the robot carries (4, 4); None for one that is fixed.
        """
        aside = _ASIDE
        if pose is not None and self._pose is not None and stamp > self._stamp:
            aside = sweep(points, self._pose, pose, stamp - self._stamp)
        self._pose, self._stamp = pose, stamp
        return self._tracks.update(stamp, points, self._sigma, aside)
