"""A campaign's results in numbers: what `--json` prints, and all that the page shows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.limit.row import Limit
from qpsafe.sim.campaign.report.comparisons import REFERENCES, Comparison, Judged, judge
from qpsafe.sim.campaign.report.findings import findings
from qpsafe.sim.campaign.report.limits import limits_summary
from qpsafe.sim.campaign.report.measures import FIGURES, SHARES
from qpsafe.sim.campaign.report.statistics import CONFIDENCE, LEAST, RESAMPLES, Share, share
from qpsafe.sim.campaign.report.swaps import FEW
from qpsafe.sim.campaign.runner import Results
from qpsafe.sim.campaign.trials.rows import CLASSES, Columns, of_controller

WORST = 10

METHODS = (
    "Controllers are paired: in a trial all of them meet the same people, with the same noise, on the same seed.",
    "Shares of trials: exact two-sided limits at 95 % (Clopper and Pearson). For none of n trials the rule of three, "
    "below 3/n at 95 % (one-sided), and the exact limit 1 - 0.05^(1/n) are given.",
    "Figures and differences: percentile bootstrap of whole trials, the same resamples for all controllers, seed 0. "
    f"Quantiles are order statistics, without interpolation. Fewer than {LEAST} trials have no limits.",
    "p-values of shares: McNemar's test, exact and two-sided. Of figures: the bootstrap's percentiles "
    "inverted, two-sided, never below 2/(resamples + 1), nor below 2^(1-k) of k trials that differ.",
    f"p-values of quantiles of fewer than {FEW} trials, and of means that differ in fewer than {FEW}: how often a "
    "difference at least as large comes out when the two values of each trial change places at random; exact for up to "
    "13 trials.",
    "All comparisons of this report with the references are corrected together by Holm's step-down method.",
)


def summary(
    results: Results,
    progress: Callable[[int, int], None] | None = None,
    speed: float | None = None,
    limits: Mapping[str, Sequence[Limit]] | None = None,
    resamples: int = RESAMPLES,
) -> dict[str, Any]:
    """Everything that a report says, for JSON.

    Times stand under `engine` alone: all the rest is the same for the same rows.

    Args:
        results: With at least one finished trial.
        progress: Called with resamples done and wanted.
        speed: Of the engine with the default controller, see `engine_speed`; None where it was not timed.
        limits: What was possible in the contacts of some controllers; None where that was not searched.
        resamples: Of the bootstrap, at least.

    Raises:
        ConfigurationError: No trial is finished.
    """
    plan = results.plan
    if results.trials == 0:
        raise ConfigurationError("campaign", "trials", 0, "at least one that is finished")
    rows = {name: of_controller(results.columns, name) for name in plan.controllers}
    judged = judge(rows, progress, resamples)
    trials = results.columns["trial"]
    return {
        "controllers": {name: _controller(name, mine, judged) for name, mine in rows.items()},
        "findings": findings(rows),
        "comparisons": [_comparison(item) for item in judged.comparisons],
        "references": [name for name in REFERENCES if name in rows],
        "worst": {name: worst(mine) for name, mine in rows.items()},
        **({"limits": {name: limits_summary(found) for name, found in limits.items()}} if limits else {}),
        "engine": {
            "simulated_s_per_wall_s": speed,
            "all_controllers_s_per_process_s": results.speed,
            "simulated_s": float(results.columns["simulated"].sum()),
            "processes_s": results.seconds,
            "wall_s": results.wall,
        },
        "seeds": [plan.seed_of(int(trials.min())), plan.seed_of(int(trials.max()))],
        "trials": {"finished": results.trials, "planned": plan.trials},
        "plan": plan.to_dict(),
        "versions": results.versions,
        "statistics": {
            "confidence": CONFIDENCE,
            "resamples": judged.resamples,
            "comparisons": len(judged.comparisons),
            "methods": list(METHODS),
        },
    }


def worst(mine: Columns, count: int = WORST) -> list[dict[str, Any]]:
    """Trials of a controller with the most harm first.

    Args:
        mine: Its rows.
        count: How many.
    """
    order = np.lexsort((mine["trial"], -mine["search"]))[:count]
    names = ("trial", "seed", "motion", "search", "contact", "contact_class", "contact_region", "distance")
    more = ("robot_speed", "closing_speed", "energy", "energy_share", "near_seen")
    return [{name: mine[name][k].item() for name in names + more} for k in order]


def _controller(name: str, mine: Columns, judged: Judged) -> dict[str, Any]:
    """The figures of the contract, flat; all limits beside them."""
    shares = {item.name: share(item.hits(mine)) for item in SHARES}
    figures = {item.name: judged.figures[name, item.name] for item in FIGURES}
    touched = mine["contact"]
    return {
        "trials": len(touched),
        **{key: found.hits for key, found in shares.items()},
        **{key: found.value for key, found in figures.items()},
        "intervals": {key: [found.low, found.high] for key, found in (shares | figures).items()},
        "none_of_n": {key: _below(found) for key, found in shares.items() if found.below is not None},
        "classes": _counts(mine["contact_class"][touched], CLASSES[1:]),
        "regions": _counts(mine["contact_region"][touched]),
        "seen": {"seen": int((touched & mine["near_seen"]).sum()), "unseen": int((touched & ~mine["near_seen"]).sum())},
        "motions": {str(motion): _motion(mine, str(motion)) for motion in np.unique(mine["motion"])},
        "sensor": str(mine["sensor"][0]),
        "limit_excess": float(np.nanmax(mine["limit_excess"])),
        "bad_ticks": int(mine["bad_ticks"].sum()),
    }


def _below(found: Share) -> dict[str, float | None]:
    return {"rule_of_three": found.below, "exact": found.below_exact}


def _counts(values: NDArray[Any], order: tuple[str, ...] = ()) -> dict[str, int]:
    found: Counter[str] = Counter(values.tolist())
    return {name: found[name] for name in (*order, *sorted(set(found) - set(order)))}


def _motion(mine: Columns, motion: str) -> dict[str, Any]:
    found = share(mine["contact"][mine["motion"] == motion])
    return {"trials": found.trials, "contacts": found.hits, "interval": [found.low, found.high]}


def _comparison(item: Comparison) -> dict[str, Any]:
    return {
        "measure": item.measure,
        "controller": item.controller,
        "reference": item.reference,
        "difference": item.difference.value,
        "interval": [item.difference.low, item.difference.high],
        "p": item.p,
        "p_holm": item.adjusted,
        "only_controller": item.only_controller,
        "only_reference": item.only_reference,
    }
