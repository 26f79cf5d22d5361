"""Every controller against the references, pair by pair of trials, with one correction over all of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from qpsafe.sim.campaign.report.measures import FIGURES, SHARES
from qpsafe.sim.campaign.report.statistics import MEAN, RESAMPLES, Array, Bootstrap, Estimate, Statistic, holm, mcnemar
from qpsafe.sim.campaign.trials.rows import Columns

#: Whom the others are compared with: what cells do today, and what qpsafe does by itself.
REFERENCES = ("stop", "default")
#: Resamples for each comparison: p-values must become small enough to survive the correction for their number.
_EACH = 100


class Comparison(NamedTuple):
    """A controller less a reference, by one measure.

    Attributes:
        measure: Name of the measure.
        controller: Who is compared.
        reference: With whom.
        difference: Controller less reference, with limits; shares as shares, figures in SI.
        p: Of no difference: McNemar's for shares, the bootstrap's for figures.
        adjusted: The same after Holm's correction for all comparisons of the report.
        only_controller: Of shares: trials in which it happened to the controller only; else None.
        only_reference: The same for the reference.
    """

    measure: str
    controller: str
    reference: str
    difference: Estimate
    p: float
    adjusted: float
    only_controller: int | None = None
    only_reference: int | None = None


class Judged(NamedTuple):
    """All that resampling gives.

    Attributes:
        figures: (controller, measure) -> value with limits, SI.
        comparisons: Of every controller with every reference, by every measure that is compared.
        resamples: How many there were.
    """

    figures: dict[tuple[str, str], Estimate]
    comparisons: tuple[Comparison, ...]
    resamples: int


def pairs(controllers: Sequence[str]) -> list[tuple[str, str]]:
    """Who is compared with which reference; two references with each other once."""
    found: list[tuple[str, str]] = []
    for reference in (name for name in REFERENCES if name in controllers):
        found += [(c, reference) for c in controllers if c != reference and (reference, c) not in found]
    return found


def judge(
    rows: dict[str, Columns], progress: Callable[[int, int], None] | None = None, resamples: int = RESAMPLES
) -> Judged:
    """Resample trials, and compare.

    Args:
        rows: Of each controller, the same trials in the same order.
        progress: Called with resamples done and wanted.
        resamples: At least; more if there are many comparisons.
    """
    who = pairs(list(rows))
    shares, figures = [m for m in SHARES if m.compared], [m for m in FIGURES if m.compared]
    wanted = max(resamples, _EACH * len(who) * (len(shares) + len(figures)))
    values: dict[str, Array] = {}
    items: dict[str, Sequence[Statistic]] = {}
    for name, mine in rows.items():
        for share in shares:
            values[f"{name} {share.name}"] = share.hits(mine).astype(float)
            items[f"{name} {share.name}"] = [MEAN]
        for figure in FIGURES:
            values[f"{name} {figure.name}"] = figure.values(mine).astype(float)
            items[f"{name} {figure.name}"] = [figure.item]
    heard = None if progress is None else lambda done: progress(done, wanted)
    made = Bootstrap(values, items, wanted, progress=heard)
    found: list[Comparison] = []
    for controller, reference in who:
        for share in shares:
            test = mcnemar(share.hits(rows[controller]), share.hits(rows[reference]))
            differs = made.difference(f"{controller} {share.name}", f"{reference} {share.name}", MEAN)
            found.append(Comparison(share.name, controller, reference, differs, test.p, 1.0, *test[:2]))
        for figure in figures:
            differs = made.difference(f"{controller} {figure.name}", f"{reference} {figure.name}", figure.item)
            found.append(Comparison(figure.name, controller, reference, differs, differs.p or 0.0, 1.0))
    adjusted = holm([item.p for item in found])
    return Judged(
        {(name, m.name): made.estimate(f"{name} {m.name}", m.item) for name in rows for m in FIGURES},
        tuple(item._replace(adjusted=float(p)) for item, p in zip(found, adjusted, strict=True)),
        wanted,
    )
