"""Where the robot was when an image was taken: its measured configurations of the last seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Configurations:
    """A ring of times and configurations.

    Args:
        joints: n.
        span: For how long they are kept at least [s]. Where ticks are too short for that, those that follow one another
            fast replace each other.
        count: How many are kept.
    """

    def __init__(self, joints: int, span: float, count: int = 512) -> None:
        self._times, self._qs = np.full(count, -np.inf), np.zeros((count, joints))
        self._next, self._apart = 0, 2.0 * span / (count - 2)  # from one to the next but one

    def reset(self) -> None:
        """Forget all."""
        self._times[:] = -np.inf
        self._next = 0

    def take(self, time: float, q: Array) -> None:
        """Remember a configuration (n,) [rad] at a time [s]; a clock that went back begins anew."""
        count = len(self._times)
        if self._next and not time > self._times[(self._next - 1) % count]:
            self.reset()
        if self._next > 1 and time - self._times[(self._next - 2) % count] < self._apart:
            self._next -= 1
        self._times[self._next % count], self._qs[self._next % count] = time, q
        self._next += 1

    def at(self, time: float) -> Array:
        """The configuration at a time, between two that were measured by the straight line (n,) [rad].

        Before the first one it is that one, after the last one the last.
        """
        count, latest = len(self._times), self._next - 1
        oldest, times = max(self._next - count, 0), self._times
        later, last = latest, float(times[latest % count])
        if time >= last:
            return self._qs[latest % count].copy()
        if latest > oldest:  # ticks are even, nearly: about here
            step = last - float(times[(latest - 1) % count])
            later = max(latest - int(min((last - time) / max(step, 1e-9), latest - oldest)), oldest)
        while later < latest and times[later % count] < time:
            later += 1
        while later > oldest and times[(later - 1) % count] >= time:
            later -= 1
        b = later % count
        if later == oldest:
            return self._qs[b].copy()
        a = (later - 1) % count
        share = (time - times[a]) / (times[b] - times[a])
        return np.asarray(self._qs[a] + share * (self._qs[b] - self._qs[a]))
