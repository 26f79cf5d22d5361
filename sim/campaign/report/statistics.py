"""Statistics of paired trials: shares with exact limits, McNemar's test, paired bootstrap, Holm's correction.

Everything compared is paired: controllers meet the same people on the same seeds, so what differs between two of them
is judged trial by trial. Nothing here depends on the order of the trials but the bootstrap's draws, which are seeded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.placement.statistics import clopper_pearson

Array = NDArray[np.float64]

CONFIDENCE = 0.95
RESAMPLES = 10_000
#: Resamples whose weights are in memory at the same time, times trials: 8 bytes each.
_BLOCK = 4_000_000


class Share(NamedTuple):
    """A share of counted trials.

    Attributes:
        hits: In how many trials it happened.
        trials: Of how many.
        value: hits / trials.
        low: Lower limit, two-sided, by Clopper and Pearson.
        high: Upper limit of the same.
        below: With none counted, the one-sided upper limit by the rule of three, 3/n; else None.
        below_exact: The exact one, 1 - 0.05^(1/n), for 95 %.
    """

    hits: int
    trials: int
    value: float
    low: float
    high: float
    below: float | None = None
    below_exact: float | None = None


def share(hits: ArrayLike) -> Share:
    """Share of trials in which something happened, with exact limits at 95 %.

    Args:
        hits: One truth value a trial, at least one.
    """
    happened = np.asarray(hits, dtype=bool)
    count, trials = int(happened.sum()), happened.size
    low, high = clopper_pearson(count, trials, CONFIDENCE)
    none = count == 0
    return Share(
        count,
        trials,
        count / trials,
        float(low),
        float(high),
        min(3.0 / trials, 1.0) if none else None,
        -float(np.expm1(np.log1p(-CONFIDENCE) / trials)) if none else None,
    )


class McNemar(NamedTuple):
    """Two controllers on the same trials: what happened to one of them only.

    Attributes:
        only_first: Trials in which it happened to the first controller and not to the second.
        only_second: The reverse.
        p: Two-sided exact p-value: of `only_first` among both, were either as likely as the other.
    """

    only_first: int
    only_second: int
    p: float


def mcnemar(first: ArrayLike, second: ArrayLike) -> McNemar:
    """McNemar's test, exact.

    Args:
        first: One truth value a trial.
        second: Of the other controller, the same trials in the same order.
    """
    from scipy.stats import binomtest

    a, b = _paired(first, second)
    only_a, only_b = int((a & ~b).sum()), int((b & ~a).sum())
    either = only_a + only_b
    return McNemar(only_a, only_b, float(binomtest(only_a, either).pvalue) if either else 1.0)


def _paired(first: ArrayLike, second: ArrayLike) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    if a.shape != b.shape or a.ndim != 1:
        raise ConfigurationError("statistics", "trials", (a.shape, b.shape), "the same trials of both controllers")
    return a, b


class Statistic(NamedTuple):
    """A mean, or a quantile.

    Attributes:
        quantile: Between 0 and 1; None for the mean. It is an order statistic, the smallest value that at least this
            share of the trials do not exceed: no interpolation.
    """

    quantile: float | None = None

    def of(self, values: Array) -> float:
        """Its value for trials (n,)."""
        if self.quantile is None:
            unit = _unit(values)
            return float(np.rint(values / unit).sum()) * unit / len(values)
        return float(np.quantile(values, self.quantile, method="inverted_cdf"))


MEAN = Statistic()
MEDIAN = Statistic(0.5)


class Estimate(NamedTuple):
    """A figure with its limits.

    Attributes:
        value: From the trials.
        low: Lower limit at 95 %.
        high: Upper limit at 95 %.
        p: Of differences: two-sided p-value of no difference, never below 2/(resamples + 1); else None.
    """

    value: float
    low: float
    high: float
    p: float | None = None


class Bootstrap:
    """Resamples of trials, the same ones for every controller and figure: that is what pairs them.

    Limits are percentiles of the resampled figures. A difference's p-value inverts them: twice the smaller share of
    resamples on either side of zero, counting the observation itself as one on both.

    Args:
        values: A column for each controller and figure: name -> one finite value a trial.
        wanted: Statistics of each column.
        resamples: How many.
        seed: Of the draws.
        progress: Called with resamples done.

    Raises:
        ConfigurationError: Columns of different lengths, empty ones, or values that are not finite.
    """

    def __init__(
        self,
        values: dict[str, Array],
        wanted: dict[str, Sequence[Statistic]],
        resamples: int = RESAMPLES,
        seed: int = 0,
        progress: Callable[[int], None] | None = None,
    ) -> None:
        lengths = {len(column) for column in values.values()}
        if len(lengths) > 1 or 0 in lengths:
            raise ConfigurationError(
                "Bootstrap", "values", sorted(lengths), "columns of one length, at least one trial"
            )
        for name, column in values.items():
            if not np.isfinite(column).all():
                raise ConfigurationError("Bootstrap", f"values[{name!r}]", "NaN or infinity", "finite values")
        self.values = values
        self.drawn: dict[tuple[str, Statistic], Array] = {
            (name, item): np.empty(resamples) for name in values for item in wanted[name]
        }
        trials = lengths.pop() if lengths else 1
        means = [key for key in self.drawn if key[1].quantile is None]
        ranked = [(key, _Ranks(values[key[0]], key[1].quantile)) for key in self.drawn if key[1].quantile is not None]
        # one matrix product gives all means, and how many of a resample lie before each window of ranks
        units = [_unit(values[name]) for name, _ in means]
        columns = [np.rint(values[key[0]] / unit) for key, unit in zip(means, units, strict=True)]
        columns += [ranks.before for _, ranks in ranked]
        products = np.stack(columns) if columns else np.empty((0, trials))
        done = 0
        for weights in _weights(trials, resamples, seed):
            rows = slice(done, done + weights.shape[1])
            sums = products @ weights
            for k, key in enumerate(means):
                self.drawn[key][rows] = sums[k] * units[k] / trials
            for k, (key, ranks) in enumerate(ranked, start=len(means)):
                self.drawn[key][rows] = ranks.quantiles(weights, sums[k])
            done = rows.stop
            if progress is not None:
                progress(done)

    def estimate(self, name: str, item: Statistic) -> Estimate:
        """A figure with its limits."""
        return Estimate(item.of(self.values[name]), *_limits(self.drawn[name, item]))

    def difference(self, first: str, second: str, item: Statistic) -> Estimate:
        """First less second, with limits and p-value.

        Args:
            first: Name of a column.
            second: Name of another one.
            item: Statistic of both.
        """
        drawn = self.drawn[first, item] - self.drawn[second, item]
        value = item.of(self.values[first]) - item.of(self.values[second])
        beside = min((drawn <= 0.0).sum(), (drawn >= 0.0).sum())
        return Estimate(value, *_limits(drawn), min(2.0 * (1.0 + float(beside)) / (1.0 + len(drawn)), 1.0))


def _unit(column: Array) -> float:
    """A power of two of which a column's values are taken as whole multiples.

    So many bits are left to them that sums over a resample are whole numbers below 2^53: exact, hence the same in every
    order of summation, by however many threads. A value of n is off by at most n/2^52 of the largest one.
    """
    largest = float(np.abs(column).max())
    bits = 52 - int(np.ceil(np.log2(len(column))))
    return 2.0 ** (int(np.ceil(np.log2(largest))) - bits) if largest > 1e-200 else 1.0


class _Ranks:
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


def _weights(trials: int, resamples: int, seed: int) -> Iterator[Array]:
    """How often each trial is in each resample, (trials, some resamples), block by block."""
    rng = np.random.default_rng(seed)
    size = max(_BLOCK // trials, 1)
    for first in range(0, resamples, size):
        count = min(size, resamples - first)
        drawn = rng.integers(trials, size=(count, trials)) + trials * np.arange(count)[:, None]
        found = np.bincount(drawn.ravel(), minlength=count * trials).reshape(count, trials)
        yield found.T.astype(np.float64, order="C")


def _limits(drawn: Array) -> tuple[float, float]:
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = np.quantile(drawn, (tail, 1.0 - tail))
    return float(low), float(high)


def holm(p: ArrayLike) -> Array:
    """p-values adjusted for their number by Holm's step-down method, in the order given.

    The k-th smallest of m is multiplied by m - k + 1, and is no smaller than the one before it, nor above 1: rejecting
    what is below 0.05 has a probability of at most 0.05 of any false rejection among all, whatever their dependence.
    """
    values = np.asarray(p, dtype=float)
    order = np.argsort(values, kind="stable")
    steps = np.maximum.accumulate(values[order] * np.arange(len(values), 0, -1))
    adjusted = np.empty(len(values))
    adjusted[order] = np.minimum(steps, 1.0)
    return adjusted
