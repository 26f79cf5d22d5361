"""The finals: the most promising trials of a search meet people whom it did not know, and the choice is made by these.

Whoever is best of many in the same few encounters was lucky there, too (the winner's curse): on the search's own people
most of a front looks better than it is. So the figures of the front are those of the finals, and the judgement has
people of its own once more.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.alone import alone_in
from qpsafe.sim.campaign.executors import crew_at_work
from qpsafe.sim.tuning.hall import Hall, promising
from qpsafe.sim.tuning.journal import Journal
from qpsafe.sim.tuning.objectives import score
from qpsafe.sim.tuning.play import PieceFunction
from qpsafe.sim.tuning.search import APART, SEARCH, Search
from qpsafe.sim.tuning.trial import Trial

#: Encounters of the finals, and how many get there beside the present values.
ENCOUNTERS, FINALISTS = 972, 8
#: Finalists that play together, and are written down together.
TOGETHER = 3
MOST = APART // 2


def run_finals(
    search: Search,
    kept: Journal,
    encounters: int = ENCOUNTERS,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    workers: int = 1,
    play: PieceFunction | None = None,
    notice: Callable[[str], None] | None = None,
) -> list[Trial]:
    """Play the finals of what a search has tried, or what is left of them.

    Args:
        search: Which.
        kept: Its journal, the present values at least; what is played is kept in it.
        encounters: How many, each met by all finalists.
        executor: Any of `concurrent.futures`, or Dask's; None for processes of our own.
        progress: Told how many runs are done, and of how many.
        workers: Processes, if there is no executor; 1 for none but this one.
        play: Plays a piece; by default `qpsafe.sim.tuning.play.play_piece`.
        notice: Told in words when a process has died.

    Returns:
        The present values first, then the finalists, as trials with the figures of the finals; none but the present
        values if nothing else keeps the constraints.

    Raises:
        ConfigurationError: There are not that many encounters, or another process is at work in the journal's folder.
        WorkerDiedError: A process died twice of the same piece.
    """
    if not 1 <= encounters <= MOST:
        raise ConfigurationError("run_finals", "encounters", encounters, f"a number from 1 to {MOST:,}")
    plan = replace(search.plan, seed=SEARCH + APART * search.seed + MOST, trials=encounters)
    named = [kept.trials[0], *finalists(kept.trials)]
    total, done = encounters * len(named), sum(min(len(kept.finals.get(t.number, ())), encounters) for t in named)
    told = _told(progress, done, total)
    with alone_in(kept.folder), crew_at_work(executor, workers) as crew:
        hall = Hall(search.plan, search.rungs, search.space(), crew, play, notice)
        for at in range(0, len(named), TOGETHER):
            some = named[at : at + TOGETHER]
            first = min(len(kept.finals.get(trial.number, ())) for trial in some)
            if first < encounters:
                runs = hall.runs(plan, range(first, encounters), [trial.point for trial in some], told)
                kept.keep_finals(
                    {trial.number: (first, mine) for trial, mine in zip(some, runs, strict=True)}, hall.spent()
                )
    reference = {0: kept.finals[0][:encounters]}
    found = []
    for trial in named:
        mine = score({0: kept.finals[trial.number][:encounters]}, reference)
        # servos with lag are the search's to judge
        constraints = trial.score.constraints | mine.constraints
        found.append(trial._replace(encounters=encounters, score=mine._replace(constraints=constraints)))
    return found


def finalists(trials: list[Trial], count: int = FINALISTS) -> list[Trial]:
    """The most promising of a search's trials that met everybody and kept the constraints, without the present values.

    Args:
        trials: All, the present values first.
        count: At most.
    """
    among = {trial.number: trial for trial in trials[1:] if trial.counts}
    scores = {number: trial.score for number, trial in among.items()}
    return [among[number] for number in promising(scores, trials[:1], count)]


def _told(progress: Callable[[int, int], None] | None, done: int, total: int) -> Callable[[int], None] | None:
    """Counts runs for a progress function."""
    if progress is None:
        return None
    count = done
    progress(count, total)

    def tell(more: int) -> None:
        nonlocal count
        count = min(count + more, total)
        progress(count, total)

    return tell
