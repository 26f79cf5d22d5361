"""How long answers take: a histogram that never grows, so that a day fits as well as a minute."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

RESOLUTION = 1e-6  # width of a bin [s]
BINS = 100_000  # up to 0.1 s; what is longer is counted, and the longest kept


class Latency:
    """Times of single events, kept in bins of a microsecond.

    Attributes:
        count: How many were recorded.
        maximum: The longest [s], exact.
    """

    def __init__(self) -> None:
        self._bins = np.zeros(BINS + 1, dtype=np.int64)  # the last one: longer
        self.reset()

    def reset(self) -> None:
        """Forget all."""
        self._bins[:] = 0
        self.count, self.maximum, self._sum = 0, 0.0, 0.0

    def record(self, seconds: float) -> None:
        """Take one time; what is not a number >= 0 (a clock that was set back) counts as 0."""
        seconds = seconds if seconds >= 0.0 else 0.0
        self._bins[min(int(seconds / RESOLUTION), BINS)] += 1
        self.count += 1
        self._sum += seconds
        if seconds > self.maximum:
            self.maximum = seconds

    def percentile(self, percent: float) -> float:
        """The time that `percent` of all do not exceed [s], rounded up to a bin's end; NaN without any."""
        if self.count == 0:
            return math.nan
        rank = max(math.ceil(percent / 100.0 * self.count), 1)
        bin_ = int(np.searchsorted(np.cumsum(self._bins), rank))
        return self.maximum if bin_ >= BINS else min((bin_ + 1) * RESOLUTION, self.maximum)

    def above(self, seconds: float) -> int:
        """How many took longer, to a microsecond."""
        return int(self._bins[min(round(seconds / RESOLUTION), BINS) :].sum())

    def summary(self) -> dict[str, Any]:
        """Figures in seconds."""
        return {
            "count": self.count,
            "mean": self._sum / self.count if self.count else math.nan,
            "p50": self.percentile(50.0),
            "p99": self.percentile(99.0),
            "p99.9": self.percentile(99.9),
            "maximum": self.maximum if self.count else math.nan,
        }

    def decades(self, edges: tuple[float, ...] = (2e-4, 5e-4, 1e-3, 2e-3, 4e-3, 1e-2, 3e-2)) -> list[tuple[str, int]]:
        """A coarse histogram: (label, count) per range, the last one open."""
        rows, last, label = [], 0.0, ""
        total = 0
        for edge in edges:
            below = int(self._bins[: round(edge / RESOLUTION)].sum())
            label = f"{1e3 * last:g} to {1e3 * edge:g} ms"
            rows.append((label, below - total))
            last, total = edge, below
        rows.append((f"above {1e3 * last:g} ms", self.count - total))
        return rows
