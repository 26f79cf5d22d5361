"""Smooth moves of one number: the building block of the choreography."""

from __future__ import annotations

import bisect
import math


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

    def __call__(self, time: float) -> float:
        """The value at a time [s]."""
        index = bisect.bisect_right(self._starts, time) - 1
        if index < 0:
            return self._first
        duration, ramp, a, b = self._glides[index]
        t = time - self._starts[index]
        if t >= duration:
            return b
        # speed / full speed: (1 - cos(pi t / ramp)) / 2 on the ramps, 1 between; integrated, symmetric in time
        s = min(t, duration - t)
        if s < ramp:
            covered = 0.5 * (s - ramp / math.pi * math.sin(math.pi * s / ramp))
        else:
            covered = s - 0.5 * ramp
        share = covered / (duration - ramp)
        return a + (b - a) * (share if t <= duration - t else 1.0 - share)
