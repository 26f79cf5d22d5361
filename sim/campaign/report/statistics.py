"""Statistics of paired trials: shares with exact limits, McNemar's test, paired bootstrap, Holm's correction.

Everything compared is paired: controllers meet the same people on the same seeds, so what differs between two of them
is judged trial by trial. Nothing here depends on the order of the trials but the bootstrap's draws, which are seeded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.placement.statistics import clopper_pearson
from qpsafe.sim.campaign.report.resamples import Ranks, unit_of, weights_of
from qpsafe.sim.campaign.report.swaps import few, least_p, swapped_p

Array = NDArray[np.float64]

CONFIDENCE = 0.95
RESAMPLES = 10_000
#: Fewer trials have no limits at 95 %: their range itself holds a median with a probability of 1 - 2^(1-n) only.
LEAST = 6


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
            unit = unit_of(values)
            return float(np.rint(values / unit).sum()) * unit / len(values)
        return float(np.quantile(values, self.quantile, method="inverted_cdf"))


MEAN = Statistic()
MEDIAN = Statistic(0.5)


class Estimate(NamedTuple):
    """A figure with its limits.

    Attributes:
        value: From the trials.
        low: Lower limit at 95 %; NaN of fewer trials than `LEAST`.
        high: Upper limit at 95 %; NaN likewise.
        p: Of differences: two-sided p-value of no difference, see `Bootstrap`; else None.
    """

    value: float
    low: float
    high: float
    p: float | None = None


class Bootstrap:
    """Resamples of trials, the same ones for every controller and figure: that is what pairs them.

    Limits are percentiles of the resampled figures. A difference's p-value inverts them: twice the smaller share of
    resamples on either side of zero, counting the observation itself as one on both; never below `least_p`. Of few
    trials it is that of swaps, see `qpsafe.sim.campaign.report.swaps`.

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
        self._trials = trials = lengths.pop() if lengths else 1
        means = [key for key in self.drawn if key[1].quantile is None]
        ranked = [(key, Ranks(values[key[0]], key[1].quantile)) for key in self.drawn if key[1].quantile is not None]
        # one matrix product gives all means, and how many of a resample lie before each window of ranks
        units = [unit_of(values[name]) for name, _ in means]
        columns = [np.rint(values[key[0]] / unit) for key, unit in zip(means, units, strict=True)]
        columns += [ranks.before for _, ranks in ranked]
        products = np.stack(columns) if columns else np.empty((0, trials))
        done = 0
        for weights in weights_of(trials, resamples, seed):
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
        return Estimate(item.of(self.values[name]), *self._limits(self.drawn[name, item]))

    def difference(self, first: str, second: str, item: Statistic) -> Estimate:
        """First less second, with limits and p-value.

        Args:
            first: Name of a column.
            second: Name of another one.
            item: Statistic of both.
        """
        drawn = self.drawn[first, item] - self.drawn[second, item]
        one, other = self.values[first], self.values[second]
        if few(one, other, item.quantile):
            p = swapped_p(one, other, item.quantile, len(drawn))
        else:
            beside = min((drawn <= 0.0).sum(), (drawn >= 0.0).sum())
            p = max(min(2.0 * (1.0 + float(beside)) / (1.0 + len(drawn)), 1.0), least_p(one, other))
        return Estimate(item.of(one) - item.of(other), *self._limits(drawn), p)

    def _limits(self, drawn: Array) -> tuple[float, float]:
        if self._trials < LEAST:
            return float("nan"), float("nan")
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
