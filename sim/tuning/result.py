"""The result of a tuning in numbers: what `--json` prints, and all that the page shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from qpsafe.sim.tuning.finals import MOST
from qpsafe.sim.tuning.front import knee
from qpsafe.sim.tuning.judge import Judged, sentence
from qpsafe.sim.tuning.sensitivity import sensitivity
from qpsafe.sim.tuning.trial import Trial, front_of

if TYPE_CHECKING:
    from qpsafe.sim.tuning.journal import Journal
    from qpsafe.sim.tuning.search import Search
    from qpsafe.sim.tuning.space import Space


class Tuned(NamedTuple):
    """What a search found.

    Attributes:
        search: Which.
        space: Where it looked.
        trials: All.
        finalists: The present values and those that met new people, with their figures there; empty without finals.
        best: The front, from little harm to little work lost: of the finalists, or of all trials without finals.
        chosen: Of it.
        prefer: By which preference.
        seconds: Processor time of the search [s].
    """

    search: Search
    space: Space
    trials: list[Trial]
    finalists: list[Trial]
    best: list[Trial]
    chosen: Trial
    prefer: str
    seconds: float

    @classmethod
    def of(cls, search: Search, space: Space, journal: Journal, prefer: str, finalists: Sequence[Trial] = ()) -> Tuned:
        """From what a search has kept.

        Args:
            search: Which.
            space: Where it looked.
            journal: What it has kept, the present values at least.
            prefer: A key of `qpsafe.sim.tuning.front.PREFERENCES`.
            finalists: See `qpsafe.sim.tuning.finals.run_finals`; the choice is among them, if there are any.
        """
        among = list(finalists) or journal.trials
        best = front_of(among) or among[:1]  # the present values themselves pass a limit
        chosen = best[knee([trial.objectives for trial in best], among[0].objectives, prefer)]
        return cls(search, space, journal.trials, list(finalists), best, chosen, prefer, journal.seconds)

    @property
    def start(self) -> Trial:
        """The present values, on the encounters of the front."""
        return (self.finalists or self.trials)[0]

    @property
    def run(self) -> str:
        """Which run it was, in a line for the robot's file."""
        return (
            f"search {self.search.seed}, {len(self.trials)} trials, {self.prefer}, trial {self.chosen.number}, "
            f"plan {self.search.plan.digest()[:8]}"
        )


def result(found: Tuned, judged: Judged | None) -> dict[str, Any]:
    """Everything that is known, for JSON.

    Args:
        found: Of the search.
        judged: The chosen values against the present ones; None where they are the same, or were not judged.
    """
    space, plan = found.space, found.search.plan
    return {
        "robot": plan.robot,
        "run": found.run,
        "sentence": said(found, judged),
        "present": _point(found, found.start),
        "chosen": _point(found, found.chosen),
        "front": [_point(found, trial) for trial in found.best],
        "finals": _finals(found),
        "judgement": None if judged is None else judged.to_dict(),
        "sensitivity": sensitivity(space, found.trials),
        "space": [d._asdict() for d in space.dimensions],
        "trials": [
            {
                "number": t.number, "encounters": t.encounters, "whole": t.whole, "harm": t.score.harm,
                "lost": t.score.lost, "violation": t.score.violation,
            }
            for t in found.trials
        ],
        "search": {
            "seed": found.search.seed, "encounters": [plan.seed, plan.seed + plan.trials - 1],
            "rungs": found.search.rungs._asdict(), "processor_s": found.seconds,
        },
        "plan": plan.to_dict(),
    }  # fmt: skip


def said(found: Tuned, judged: Judged | None) -> str:
    """What it comes to, in words."""
    if judged is not None:
        return sentence(judged)
    if found.chosen.number == 0:
        return f"The present values were already as good: none of {len(found.trials) - 1:,} others was chosen."
    return "Not judged yet: figures are those of the search, which chose by them."


def _finals(found: Tuned) -> dict[str, Any] | None:
    if not found.finalists:
        return None
    first = found.search.plan.seed + MOST
    points = [{"number": t.number, "harm": t.score.harm, "lost": t.score.lost} for t in found.finalists]
    return {"encounters": [first, first + found.finalists[0].encounters - 1], "finalists": points}


def _point(found: Tuned, trial: Trial) -> dict[str, Any]:
    values = found.space.at(trial.point)
    return {"number": trial.number, **trial.score._asdict(), "point": trial.point, "values": values.tables()}
