"""Where the robot was when an image was taken: its measured configurations of the last seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Configurations:
    """A ring of times and configurations.

    Args:
        joints: n.
        count: How many are kept.
    """

    def __init__(self, joints: int, count: int = 512) -> None:
        self._times, self._qs = np.full(count, -np.inf), np.zeros((count, joints))
        self._next = 0

    def reset(self) -> None:
        """Forget all."""
        self._times[:] = -np.inf
        self._next = 0

    def take(self, time: float, q: Array) -> None:
        """Remember a configuration (n,) [rad] at a time [s]; a clock that went back begins anew."""
        count = len(self._times)
        if self._next and not time > self._times[(self._next - 1) % count]:
            self.reset()
        self._times[self._next % count], self._qs[self._next % count] = time, q
        self._next += 1

    def at(self, time: float) -> Array:
        """The configuration at a time, between two that were measured by the straight line (n,) [rad].

        Before the first one it is that one, after the last one the last.
        """
        count = len(self._times)
        # times in order: those after `_next` are the oldest
        turn = self._next % count
        times = np.concatenate((self._times[turn:], self._times[:turn])) if self._next > count else self._times[:turn]
        later = int(np.searchsorted(times, time))
        first = turn if self._next > count else 0
        if later == 0 or later == len(times):
            return self._qs[(first + min(later, len(times) - 1)) % count].copy()
        a, b = (first + later - 1) % count, (first + later) % count
        share = (time - self._times[a]) / (self._times[b] - self._times[a])
        return np.asarray(self._qs[a] + share * (self._qs[b] - self._qs[a]))
