"""Keep what a spot saw for a short while after it is lost: a ray that slips off an edge has not become safe."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError


class PointHold:
    """Last detected point of every spot, fixed in the world, forgotten `hold_time` after it was last seen.

    Without it a ray at the edge of an obstacle flickers: seen, the robot evades; lost, it comes back at once.

    Args:
        hold_time: How long a lost point still counts [s]; 0 switches the hold off.
        dt: Tick [s].

    Raises:
        ConfigurationError: The hold time is negative or not finite.
    """

    def __init__(self, hold_time: float, dt: float) -> None:
        if not (math.isfinite(hold_time) and hold_time >= 0.0):
            raise ConfigurationError("SafetyController", "hold_time", hold_time, "a finite time >= 0 [s]")
        self._limit = round(hold_time / dt)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._points = np.zeros((0, 3))
        self._age = np.zeros(0, dtype=np.int64)  # ticks since last seen

    def update(self, points: NDArray[np.float64], seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Take this tick's points and fill in those that are held.

        Args:
            points: One point per spot (k, 3) [m]; rows that are not `seen` are overwritten with held points.
            seen: Which spots detect something now (k,).

        Returns:
            Which rows of `points` count (k,): seen or held.
        """
        if len(self._age) != len(seen):
            self._points, self._age = points.copy(), np.full(len(seen), self._limit + 1)
        self._age = np.where(seen, 0, self._age + 1)
        held = ~seen & (self._age <= self._limit)
        points[held] = self._points[held]
        self._points = points.copy()
        return seen | held
