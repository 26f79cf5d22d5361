"""Keep what a spot saw for a short while after it is lost: a ray that slips off an edge has not become safe."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError

#: A reading this much farther than the last one is a different thing behind it, not the same one going away [m].
JUMP = 0.05


class PointHold:
    """Last detected point of every spot, fixed in the world, forgotten `hold_time` after it was last seen.

    A nearer reading counts at once. A reading that jumps farther away, or is gone, counts only when the point before
    it has not been seen for `hold_time`. Without this a ray at the edge of an obstacle flickers: seen, the robot
    evades; lost, it comes back at once.

    Args:
        hold_time: How long a lost point still counts [s]; 0 switches the hold off.
        dt: Tick [s].

    Raises:
        ConfigurationError: The hold time is negative or not finite.
    """

    def __init__(self, hold_time: float, dt: float) -> None:
        number = isinstance(hold_time, int | float) and not isinstance(hold_time, bool)
        if not (number and hold_time >= 0.0 and math.isfinite(hold_time / dt)):
            raise ConfigurationError("SafetyController", "hold_time", hold_time, "a finite time >= 0 [s]")
        self._limit = round(hold_time / dt)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._points = np.zeros((0, 3))
        self._distances = np.zeros(0)  # at which the points were seen, +inf for none
        self._age = np.zeros(0, dtype=np.int64)  # ticks since then

    def update(self, points: NDArray[np.float64], distances: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Take this tick's readings and put the points that are held in their place.

        Args:
            points: One point per spot (k, 3) [m]; rows whose spot lost its point are overwritten with it.
            distances: What the spots read now (k,) [m], +inf where nothing is detected.

        Returns:
            Which rows of `points` count (k,): seen or held.
        """
        if len(self._age) != len(distances):
            self._points = points.copy()
            self._distances = np.full(len(distances), np.inf)
            self._age = np.zeros(len(distances), dtype=np.int64)
        accepted = (distances <= self._distances + JUMP) | (self._age >= self._limit)
        self._age = np.where(accepted, 0, self._age + 1)
        self._distances = np.where(accepted, distances, self._distances)
        points[~accepted] = self._points[~accepted]
        self._points = points.copy()
        return np.isfinite(self._distances)
