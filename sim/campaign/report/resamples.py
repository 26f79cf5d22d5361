"""Resamples of trials: how often each trial is in each of them, and exact sums and quantiles made of that."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Resamples whose weights are in memory at the same time, times trials: 8 bytes each.
_BLOCK = 4_000_000


def unit_of(column: Array) -> float:
    """A power of two of which a column's values are taken as whole multiples.

    So many bits are left to them that sums over a resample are whole numbers below 2^53: exact, hence the same in every
    order of summation, by however many threads. A value of n is off by at most n/2^52 of the largest one.
    """
    largest = float(np.abs(column).max())
    bits = 52 - int(np.ceil(np.log2(len(column))))
    return 2.0 ** (int(np.ceil(np.log2(largest))) - bits) if largest > 1e-200 else 1.0


class Ranks:
    """Quantiles of resamples of a column, from how often each trial is in them.

    A quantile's rank hardly moves: of a resample, about Q of the n trials lie before rank Q, give or take
    √(Q (1 - Q/n)). So only a window of ranks, seven such deviations to both sides, is looked at one by one.

    Args:
        column: One value a trial, (n,).
        quantile: Which.
    """

    def __init__(self, column: Array, quantile: float | None) -> None:
        count = len(column)
        rank = (quantile or 0.0) * count
        self.need = max(int(np.ceil(rank - 1e-9)), 1)
        room = 7.0 * np.sqrt(rank * (1.0 - rank / count)) + 2.0
        first, end = max(int(rank - room), 0), min(int(rank + room) + 1, count)
        self.order = np.argsort(column, kind="stable")
        self.window = slice(first, end)
        self.rising = column[self.order]
        self.before = np.zeros(count)  # 1 where a trial's rank is before the window
        self.before[self.order[:first]] = 1.0

    def quantiles(self, weights: Array, before: Array) -> Array:
        """Of resamples.

        Args:
            weights: How often each trial is in each, (n, m).
            before: How many trials of each lie before the window, (m,).
        """
        upto = np.cumsum(weights[self.order[self.window]], axis=0) + before
        below = (upto < self.need).sum(axis=0)  # ranks of the window before the quantile's
        outside = (before >= self.need) | (below == len(upto))
        found = self.rising[self.window][np.where(outside, 0, below)]
        for k in np.flatnonzero(outside):  # next to never: all ranks
            found[k] = self.rising[(np.cumsum(weights[self.order, k]) < self.need).sum()]
        return found


def weights_of(trials: int, resamples: int, seed: int) -> Iterator[Array]:
    """How often each trial is in each resample, (trials, some resamples), block by block.

    Args:
        trials: How many there are to draw from.
        resamples: How many in all.
        seed: Of the draws.
    """
    rng = np.random.default_rng(seed)
    size = max(_BLOCK // trials, 1)
    for first in range(0, resamples, size):
        count = min(size, resamples - first)
        drawn = rng.integers(trials, size=(count, trials)) + trials * np.arange(count)[:, None]
        found = np.bincount(drawn.ravel(), minlength=count * trials).reshape(count, trials)
        yield found.T.astype(np.float64, order="C")
