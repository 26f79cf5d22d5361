"""The search: batches of values, played through the same encounters as the present ones, few first, then all.

Successive halving: all of a batch meet the first encounters; the more promising go on to more, one of them to all and
to servos with lag. Values that were stopped are told to the sampler by their paired estimate.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from time import monotonic
from typing import TYPE_CHECKING, Any

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_quietly
from qpsafe.sim.campaign.alone import alone_in
from qpsafe.sim.campaign.executors import crew_at_work
from qpsafe.sim.tuning.ask import BATCH, CANDIDATES, SPREAD, ask
from qpsafe.sim.tuning.hall import LAGS, Hall, Rungs
from qpsafe.sim.tuning.journal import Journal
from qpsafe.sim.tuning.objectives import score
from qpsafe.sim.tuning.play import PieceFunction
from qpsafe.sim.tuning.space import Space
from qpsafe.sim.tuning.trial import Trial

if TYPE_CHECKING:
    from pathlib import Path

    from qpsafe.sim.campaign.plan import Plan

#: First seeds of encounters: of searches, 10,000 apart, of which the second half is for the finals, and of the
#: judgement. Campaigns have those below.
SEARCH, JUDGE, APART, MOST = 7_000_000, 8_000_000, 10_000, 99
TRIALS = 400


@dataclass(frozen=True)
class Search:
    """What is searched.

    Attributes:
        plan: Robot, motions, people and sensor; its seed, trials and lag are the search's own.
        seed: Number of the search, 0 to `MOST`: of its encounters and of all that is random in it.
        rungs: How far values are played.
    """

    plan: Plan
    seed: int = 0
    rungs: Rungs = field(default_factory=Rungs)

    def __post_init__(self) -> None:
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or not 0 <= self.seed <= MOST:
            raise ConfigurationError("Search", "seed", self.seed, f"a whole number from 0 to {MOST}")
        first, count = SEARCH + APART * self.seed, self.rungs.encounters[-1]
        object.__setattr__(
            self, "plan", replace(self.plan, seed=first, trials=count, lag=0.0, controllers=("default",))
        )

    def space(self) -> Space:
        """Around the robot's present values."""
        return Space.of(load_quietly(self.plan.robot))

    def identity(self) -> dict[str, Any]:
        """What decides every trial."""
        rules = {"batch": BATCH, "candidates": CANDIDATES, "spread": SPREAD, "lags": LAGS}
        return {"search": self.seed, "rungs": self.rungs._asdict()} | rules | self.plan.identity()


#: Told after every batch: trials so far, and the search's journal.
Progress = Callable[[int, Journal], None]


def run_search(
    search: Search,
    trials: int = TRIALS,
    journal: Path | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    *,
    workers: int = 1,
    minutes: float | None = None,
    play: PieceFunction | None = None,
    notice: Callable[[str], None] | None = None,
) -> Journal:
    """Search, or go on.

    Args:
        search: What.
        trials: How many to play, the present values among them; whole batches.
        journal: File of what is finished; None for none.
        executor: Any of `concurrent.futures`, or Dask's; None for processes of our own.
        progress: Told after every batch.
        workers: Processes, if there is no executor; 1 for none but this one.
        minutes: After which no batch is begun; None for no limit. A shorter search is the beginning of a longer one.
        play: Plays a piece; by default `qpsafe.sim.tuning.play.play_piece`.
        notice: Told in words when a process has died.

    Raises:
        ConfigurationError: The journal is of another search, or another process is at work in its folder.
        WorkerDiedError: A process died twice of the same piece.
        MissingExtraError: optuna is not installed.
    """
    begun, space = monotonic(), search.space()
    with alone_in(None if journal is None else journal.parent):
        kept = Journal(journal, search.identity())
        with crew_at_work(executor, workers) as crew:
            hall = Hall(search.plan, search.rungs, space, crew, play, notice)
            if progress is not None:
                progress(len(kept.trials), kept)
            while len(kept.trials) < trials:
                if kept.trials and minutes is not None and monotonic() - begun >= 60.0 * minutes:
                    break
                if kept.reference is None:
                    reference = hall.whole(space.start)
                    first = Trial(0, 0, space.start, search.plan.trials, True, score(reference, reference))
                    kept.keep([first], hall.spent(), reference)
                else:
                    points = ask(space, kept.trials, search.seed, kept.batches)
                    kept.keep(hall.batch(points, kept), hall.spent())
                if progress is not None:
                    progress(len(kept.trials), kept)
    return kept
