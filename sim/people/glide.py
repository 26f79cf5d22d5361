"""Smooth moves of one number: the building block of the choreography."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Track:
    """A scalar function of time made of smooth glides; constant between them."""

    def __init__(self, value: float) -> None:
        self._starts: list[float] = []
        self._glides: list[tuple[float, float, float, float]] = []  # duration, ramp, from, to
        self.value = value  # at the end
        self._first = value

    def glide(self, start: float, to: float, speed: float, ramp: float) -> float:
        """Append a glide with cosine-shaped speed ramps [s]; returns the time it ends.

        Args:
            start: When [s].
            to: Value at the end.
            speed: Greatest speed [1/s].
            ramp: Length of each ramp [s].
        """
        # at full speed: distance = speed (duration - ramp); short glides never reach full speed
        duration = max(abs(to - self.value) / speed + ramp, 2.0 * ramp)
        self._starts.append(start)
        self._glides.append((duration, ramp, self.value, to))
        self.value = to
        return start + duration

    def __call__(self, times: Array | float) -> Array:
        """The values at times [s], in their shape."""
        times = np.asarray(times, dtype=float)
        if not self._glides:
            return np.full(times.shape, self._first)
        which = np.searchsorted(self._starts, times, side="right") - 1
        duration, ramp, a, b = np.moveaxis(np.array(self._glides)[which], -1, 0)
        t = np.clip(times - np.array(self._starts)[which], 0.0, duration)
        # speed / full speed: (1 - cos(pi t / ramp)) / 2 on the ramps, 1 between; integrated, symmetric in time
        s = np.minimum(t, duration - t)
        speeding = 0.5 * (s - ramp / math.pi * np.sin(math.pi * s / ramp))
        share = np.where(s < ramp, speeding, s - 0.5 * ramp) / (duration - ramp)
        value = a + (b - a) * np.where(t <= duration - t, share, 1.0 - share)
        return np.where(which < 0, self._first, np.where(t >= duration, b, value))
