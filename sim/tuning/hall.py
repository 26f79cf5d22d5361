"""Where values meet encounters, piece by piece: batches in rungs, the present values, the finalists."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from qpsafe.sim.campaign.executors import Crew, answers
from qpsafe.sim.tuning.front import Objectives, ranks
from qpsafe.sim.tuning.journal import Journal
from qpsafe.sim.tuning.objectives import Outcome, Played, Score, score
from qpsafe.sim.tuning.play import Piece, PieceFunction, lagged, pieces, play_piece, timed
from qpsafe.sim.tuning.space import Point, Space
from qpsafe.sim.tuning.trial import Trial, front_of

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan

#: Servo lags that values must be steady with, in ticks: 8 and 20 ms.
LAGS = (2, 5)
#: Encounters that processes take together.
SIZE = 6


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


class Hall:
    """Where values meet encounters.

    Args:
        plan: Of the search.
        rungs: How far values are played.
        space: Around the present values.
        crew: Who plays.
        play: Plays a piece; by default `qpsafe.sim.tuning.play.play_piece`.
        notice: Told in words when a process has died.
    """

    def __init__(
        self,
        plan: Plan,
        rungs: Rungs,
        space: Space,
        crew: Crew,
        play: PieceFunction | None,
        notice: Callable[[str], None] | None,
    ) -> None:
        self._plan, self._rungs, self._space = plan, rungs, space
        self._crew, self._notice = crew, notice
        self._play, self._seconds = partial(timed, play or play_piece), 0.0

    def spent(self) -> float:
        """Processes' time since it was last asked for [s]."""
        found, self._seconds = self._seconds, 0.0
        return found

    def whole(self, point: Point) -> Played:
        """A point in all encounters, and with all lags."""
        plan, rungs = self._plan, self._rungs
        (plain,) = self.runs(plan, range(rungs.encounters[-1]), [point])
        return {0: plain} | {lag: self._lagged(lag, [point])[0] for lag in LAGS}

    def batch(self, points: Sequence[Point], kept: Journal) -> list[Trial]:
        """A batch, rung by rung.

        Args:
            points: Asked for.
            kept: The trials before.
        """
        assert kept.reference is not None
        rungs, plan = self._rungs, self._plan
        played: list[Played] = [{0: []} for _ in points]
        going, done = list(range(len(points))), 0
        for level, count in enumerate(rungs.encounters):
            for k, runs in zip(going, self.runs(plan, range(done, count), [points[k] for k in going]), strict=True):
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
        return self.runs(lagged(self._plan, lag), range(self._rungs.lagged), points)

    def runs(
        self, plan: Plan, encounters: range, points: Sequence[Point], heard: Callable[[int], None] | None = None
    ) -> list[list[Outcome]]:
        """Outcomes of each point in each encounter.

        Args:
            plan: Whose encounters.
            encounters: Their numbers.
            points: All of them meet each.
            heard: Told how many runs have just come back.
        """
        work: list[Piece] = pieces(plan, encounters, [self._space.at(point) for point in points], SIZE)
        found: dict[int, list[list[Outcome]]] = {}
        with closing(answers(self._crew, self._play, list(enumerate(work)), self._notice)) as parts:
            for number, runs, seconds in parts:
                found[number] = runs
                self._seconds += seconds
                if heard is not None:
                    heard(len(runs) * len(points))
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
