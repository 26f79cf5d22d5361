"""Tuned values against the present ones among people whom neither was tuned on, encounter by encounter."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.report.measures import SHARES
from qpsafe.sim.campaign.report.statistics import MEAN, Bootstrap, Estimate, McNemar, mcnemar
from qpsafe.sim.campaign.runner import run_campaign
from qpsafe.sim.campaign.trials.harm import harm
from qpsafe.sim.campaign.trials.rows import Columns
from qpsafe.sim.tuning.search import JUDGE

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan

Array = NDArray[np.float64]

ENCOUNTERS = 1200
#: Below it a difference counts.
LEVEL = 0.001
#: Fewer encounters decide nothing, whatever came of them.
LEAST = 20


class Difference(NamedTuple):
    """A mean of both, and their difference.

    Attributes:
        present, tuned: Means.
        difference: Tuned less present, with limits at 95 % and p.
    """

    present: float
    tuned: float
    difference: Estimate


class Judged(NamedTuple):
    """What came of the judgement.

    Attributes:
        encounters: How many.
        seed: Of the first.
        means: Harm, work lost and reversals.
        shares: Of encounters in which something happened, by the report's names: McNemar's test, tuned first.
        counts: (present, tuned) of the same.
        excess: Largest of a limit by the tuned values.
    """

    encounters: int
    seed: int
    means: dict[str, Difference]
    shares: dict[str, McNemar]
    counts: dict[str, tuple[int, int]]
    excess: float

    @property
    def enough(self) -> bool:
        """Whether there are encounters enough to compare."""
        return self.encounters >= LEAST

    def better(self, key: str) -> bool:
        """Whether the tuned values are surely better in a mean."""
        return self.means[key].difference.value < 0.0 and self._surely(key)

    def worse(self, key: str) -> bool:
        """Whether they are surely worse."""
        return self.means[key].difference.value > 0.0 and self._surely(key)

    def _surely(self, key: str) -> bool:
        p = self.means[key].difference.p
        return self.enough and p is not None and p < LEVEL

    @property
    def new_faults(self) -> list[str]:
        """What the tuned values do that the present ones do less."""
        found = [name for name in ("furniture", "self") if self.counts[name][1] > self.counts[name][0]]
        return found + ([] if self.excess <= 0.0 else ["limits"])  # NaN is no excess that is kept

    @property
    def dominates(self) -> bool:
        """Whether they are surely better in both objectives, without a new fault."""
        return self.better("harm") and self.better("lost") and not self.new_faults

    @property
    def worth(self) -> bool:
        """Whether to take them: surely better in something, no more harm, not surely more lost, no new fault."""
        both = ("harm", "lost")
        gained, paid = any(map(self.better, both)), self.means["harm"].difference.value > 0.0 or self.worse("lost")
        return gained and not paid and not self.new_faults

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        means = {
            key: {"present": m.present, "tuned": m.tuned, **m.difference._asdict()} for key, m in self.means.items()
        }
        shares = {
            key: {"present": self.counts[key][0], "tuned": self.counts[key][1], **test._asdict()}
            for key, test in self.shares.items()
        }
        flags = {"dominates": self.dominates, "worth": self.worth, "new_faults": self.new_faults}
        return {"encounters": self.encounters, "seed": self.seed, "means": means, "shares": shares} | flags


def judge(
    plan: Plan,
    tuned: Path,
    encounters: int = ENCOUNTERS,
    out: Path | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    workers: int = 1,
    seed: int = JUDGE,
) -> Judged:
    """Play both through the same encounters, as campaigns of their own.

    Args:
        plan: Of the search; its robot has the present values.
        tuned: Folder of the robot with the tuned values.
        encounters: How many.
        out: Where the trials of either get a folder, so that none is played twice; None to keep them in memory only.
        executor: Any of `concurrent.futures`, or Dask's; None for processes of our own.
        progress: Told how many are done, and of how many.
        workers: Processes, if there is no executor.
        seed: Of the first encounter; none that a search has used.
    """
    base = replace(plan, seed=seed, trials=encounters, lag=0.0, controllers=("default",))

    def rows(one: Plan, before: int) -> Columns:
        folder = None if out is None else out / f"judge-{one.digest()[:8]}"
        heard = None if progress is None else _shifted(progress, before, 2 * encounters)
        return run_campaign(one, folder, executor, heard, workers=workers).columns

    return compared(rows(base, 0), rows(replace(base, robot=str(tuned)), encounters), seed)


def compared(present: Columns, tuned: Columns, seed: int) -> Judged:
    """Judge rows of the same encounters.

    Args:
        present: By the present values.
        tuned: By the tuned ones.
        seed: Of the first encounter.
    """
    columns = {
        f"{who} {key}": values
        for who, rows in (("present", present), ("tuned", tuned))
        for key, values in _objectives(rows).items()
    }
    made = Bootstrap(columns, dict.fromkeys(columns, (MEAN,)))
    means = {
        key: Difference(
            MEAN.of(columns[f"present {key}"]),
            MEAN.of(columns[f"tuned {key}"]),
            made.difference(f"tuned {key}", f"present {key}", MEAN),
        )
        for key in _objectives(present)
    }
    hits = {item.name: (item.hits(present), item.hits(tuned)) for item in SHARES}
    tests = {name: mcnemar(mine, theirs) for name, (theirs, mine) in hits.items()}
    counts = {name: (int(theirs.sum()), int(mine.sum())) for name, (theirs, mine) in hits.items()}
    return Judged(len(present["trial"]), seed, means, tests, counts, float(np.max(tuned["limit_excess"], initial=0.0)))


def _objectives(rows: Columns) -> dict[str, Array]:
    harms = harm(rows["energy_share"], rows["distance"])
    return {"harm": harms, "lost": rows["lost_time"], "reversals": rows["reversals"].astype(float)}


def _shifted(progress: Callable[[int, int], None], before: int, total: int) -> Callable[[int, int], None]:
    return lambda done, _: progress(before + done, total)


def sentence(judged: Judged) -> str:
    """What it comes to, in words."""
    said = [
        _words(judged, "harm", "harm {:.4f} instead of {:.4f}"),
        _words(judged, "lost", "lost time {:.2f} s instead of {:.2f} s"),
    ]
    touched = judged.counts["contacts"]
    test = judged.shares["contacts"]
    figures = (
        f"{'; '.join(said)}; contacts {touched[1]} instead of {touched[0]} (p = {test.p:.2g}), in "
        f"{judged.encounters:,} encounters that nothing was tuned on."
    )
    if judged.new_faults:
        return f"Do not take the tuned values: they are worse in {', '.join(judged.new_faults)}. {figures}"
    if not judged.enough:
        return f"Too few encounters to compare, {LEAST} at least: the present values stay. {figures}"
    if judged.dominates:
        return f"The tuned values are better in both: {figures}"
    if judged.worth:
        gained = "harm" if judged.better("harm") else "work lost"
        return f"The tuned values are better in {gained}, and not surely worse in the other: {figures}"
    if any(map(judged.better, ("harm", "lost"))):
        surely = any(map(judged.worse, ("harm", "lost")))
        how = "trade one for the other" if surely else "are better in work lost, and may do more harm"
        return f"The tuned values {how}; it is for you to choose: {figures}"
    return f"The present values were already as good: {figures}"


def _words(judged: Judged, key: str, text: str) -> str:
    found = judged.means[key]
    p = math.nan if found.difference.p is None else found.difference.p
    return f"{text.format(found.tuned, found.present)} (p = {p:.2g})"
