"""What chance alone makes of few trials: their values change places between the two controllers, every way there is.

A bootstrap takes the trials that it has for all there are. Of one trial it says that nothing varies, of six it still
finds differences three times too often. Were two controllers the same, the two values of a trial might as well have
changed places; how often that makes a difference as large as the one seen is a p-value without any assumption, exact
for any number of trials.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Fewer trials than this are judged by swaps; from here on the bootstrap's p-values hold what they say.
FEW = 50
#: Of the largest value: sums that differ by less are equal but for rounding.
_EQUAL = 1e-9


def few(first: Array, second: Array, quantile: float | None) -> bool:
    """Whether there are so few trials that swaps judge them; of a mean those count in which the two differ.

    Args:
        first: One value a trial (n,).
        second: Of the other controller, the same trials in the same order (n,).
        quantile: Which is compared; None for the mean.
    """
    return (len(first) if quantile is not None else int(np.count_nonzero(first != second))) < FEW


def swapped_p(first: Array, second: Array, quantile: float | None, swaps: int, seed: int = 0) -> float:
    """Two-sided p-value of no difference: the share of swaps with a difference at least as large as the one seen.

    All swaps, if there are no more than asked for; else random ones, and the observation as one of them.

    Args:
        first: One value a trial (n,).
        second: Of the other controller, the same trials in the same order (n,).
        quantile: Which is compared, see `Statistic`; None for the mean.
        swaps: How many at most.
        seed: Of random ones.
    """
    differ = np.flatnonzero(first != second)
    count = len(differ)
    if count == 0:
        return 1.0
    every = 2.0**count <= swaps
    if every:
        places = (np.arange(2**count)[:, None] >> np.arange(count) & 1).astype(bool)
    else:
        places = np.random.default_rng(seed).integers(2, size=(1 + swaps, count), dtype=np.uint8).astype(bool)
        places[0] = False  # as observed
    if quantile is None:
        found = np.abs((1.0 - 2.0 * places) @ (first - second)[differ])
    else:
        found = np.abs(_differences(first, second, differ, places, quantile))
    largest = max(float(np.abs(first).max()), float(np.abs(second).max()))
    return float((found >= found[0] - _EQUAL * largest).mean())


def least_p(first: Array, second: Array) -> float:
    """The share of one swap in all and its opposite: no test of trials that differ can have less, (n,) each."""
    return min(2.0 ** (1.0 - np.count_nonzero(first != second)), 1.0)


def _differences(
    first: Array, second: Array, differ: NDArray[np.intp], places: NDArray[np.bool_], quantile: float
) -> Array:
    """Of a quantile, for each swap (m,): `places` (m, k) says which of the trials `differ` (k,) change places."""
    rank = max(int(np.ceil(quantile * len(first) - 1e-9)), 1) - 1
    sides = []
    for one, other in ((first, second), (second, first)):
        values = np.tile(one, (len(places), 1))
        values[:, differ] = np.where(places, other[differ], one[differ])
        sides.append(np.partition(values, rank, axis=1)[:, rank])
    return np.asarray(sides[0] - sides[1], dtype=np.float64)
