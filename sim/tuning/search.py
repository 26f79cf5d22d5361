"""The search: batches of values, played through the same encounters as the present ones, few first, then all.

Successive halving: all of a batch meet the first encounters; the more promising go on to more, one of them to all and
to servos with lag. Values that were stopped are told to the sampler by their paired estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sim.campaign.executors import Alone, Crew, Given, Processes, answers
from qpsafe.sim.tuning.ask import BATCH, CANDIDATES, SPREAD, ask
from qpsafe.sim.tuning.front import Objectives, ranks
from qpsafe.sim.tuning.journal import Journal
from qpsafe.sim.tuning.objectives import Outcome, Played, Score, score
from qpsafe.sim.tuning.play import Piece, PieceFunction, lagged, pieces, play_piece, timed
from qpsafe.sim.tuning.space import Point, Space
from qpsafe.sim.tuning.trial import Trial, front_of

if TYPE_CHECKING:
    from pathlib import Path

    from qpsafe.sim.campaign.plan import Plan

#: First seeds of encounters: of searches, 10,000 apart, and of the judgement. Campaigns have those below.
SEARCH, JUDGE, APART, MOST = 7_000_000, 8_000_000, 10_000, 99
#: Servo lags that values must be steady with, in ticks: 8 and 20 ms.
LAGS = (2, 5)
#: Encounters that processes take together.
SIZE = 6
TRIALS = 400


class Rungs(NamedTuple):
    """How far values are played.

    Attributes:
        encounters: Of each rung, all encounters last; multiples of the number of motions treat these alike.
        goes_on: Share of a batch that goes on after each rung but the last.
        lagged: Encounters with each of `LAGS`, on the last rung.
    """

    encounters: tuple[int, ...] = (24, 72, 216)
    goes_on: tuple[float, ...] = (0.375, 0.125)
    lagged: int = 12


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
        return Space.of(load_robot(self.plan.robot))

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
        ConfigurationError: The journal is of another search.
        WorkerDiedError: A process died twice of the same piece.
        MissingExtraError: optuna is not installed.
    """
    begun, space = monotonic(), search.space()
    kept = Journal(journal, search.identity())
    crew: Crew = Given(executor) if executor is not None else Processes(workers) if workers > 1 else Alone()
    good = False
    try:
        hall = _Hall(search, space, crew, play or play_piece, notice)
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
        good = True
    finally:
        crew.close(at_once=not good)
    return kept


class _Hall:
    """Where batches are played."""

    def __init__(
        self,
        search: Search,
        space: Space,
        crew: Crew,
        play: PieceFunction,
        notice: Callable[[str], None] | None,
    ) -> None:
        self._search, self._space, self._crew, self._notice = search, space, crew, notice
        self._play, self._seconds = partial(timed, play), 0.0

    def spent(self) -> float:
        """Processes' time since it was last asked for [s]."""
        found, self._seconds = self._seconds, 0.0
        return found

    def whole(self, point: Point) -> Played:
        """A point in all encounters, and with all lags."""
        plan, rungs = self._search.plan, self._search.rungs
        (plain,) = self._runs(plan, range(rungs.encounters[-1]), [point])
        return {0: plain} | {lag: self._lagged(lag, [point])[0] for lag in LAGS}

    def batch(self, points: Sequence[Point], kept: Journal) -> list[Trial]:
        """A batch, rung by rung.

        Args:
            points: Asked for.
            kept: The trials before.
        """
        assert kept.reference is not None
        rungs, plan = self._search.rungs, self._search.plan
        played: list[Played] = [{0: []} for _ in points]
        going, done = list(range(len(points))), 0
        for level, count in enumerate(rungs.encounters):
            for k, runs in zip(going, self._runs(plan, range(done, count), [points[k] for k in going]), strict=True):
                played[k][0] += runs
            done = count
            if level < len(rungs.goes_on):
                scores = {k: score(played[k], kept.reference) for k in going}
                going = promising(scores, kept.trials, max(1, round(rungs.goes_on[level] * len(points))))
        for lag in LAGS:
            for k, runs in zip(going, self._lagged(lag, [points[k] for k in going]), strict=True):
                played[k][lag] = runs
        first, number = len(kept.trials), kept.batches
        return [
            Trial(first + k, number, point, len(runs[0]), k in going, score(runs, kept.reference))
            for k, (point, runs) in enumerate(zip(points, played, strict=True))
        ]

    def _lagged(self, lag: int, points: Sequence[Point]) -> list[list[Outcome]]:
        return self._runs(lagged(self._search.plan, lag), range(self._search.rungs.lagged), points)

    def _runs(self, plan: Plan, encounters: range, points: Sequence[Point]) -> list[list[Outcome]]:
        """Outcomes of each point in each encounter."""
        work: list[Piece] = pieces(plan, encounters, [self._space.at(point) for point in points], SIZE)
        found: dict[int, list[list[Outcome]]] = {}
        with closing(answers(self._crew, self._play, list(enumerate(work)), self._notice)) as parts:
            for number, runs, seconds in parts:
                found[number] = runs
                self._seconds += seconds
        rows = [row for number in sorted(found) for row in found[number]]
        return [[row[k] for row in rows] for k in range(len(points))]


def promising(scores: dict[int, Score], trials: Sequence[Trial], count: int) -> list[int]:
    """Who goes on: those that keep the constraints first, then those whom fewer dominate, then those whose worse
    objective, as a share of the present values', is smaller: what is better in both goes before what trades.

    Args:
        scores: Of a batch, by number.
        trials: Before it: those of their front dominate, too.
        count: How many.
    """
    start = trials[0].objectives
    numbers, before = list(scores), [trial.objectives for trial in front_of(trials)]
    dominated = ranks([Objectives(scores[k].harm, scores[k].lost) for k in numbers] + before)

    def key(place: int) -> tuple[float, int, float, float, int]:
        mine = scores[numbers[place]]
        shares = (mine.harm / max(start.harm, 1e-9), mine.lost / max(start.lost, 1e-9))
        return mine.violation, dominated[place], max(shares), sum(shares), numbers[place]

    return sorted(numbers[place] for place in sorted(range(len(numbers)), key=key)[:count])
