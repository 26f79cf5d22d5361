"""A trial of a search: a point, how far it was played, and what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from qpsafe.sim.tuning.front import Objectives, front
from qpsafe.sim.tuning.objectives import Played, Score
from qpsafe.sim.tuning.space import Point


class Trial(NamedTuple):
    """A trial.

    Attributes:
        number: From 0, the present values.
        batch: It was asked for in.
        point: Of the space.
        encounters: How many were played; fewer than the search's where it was not promising.
        whole: Whether all were played, those with lag too.
        score: Objectives and constraints; objectives are estimates where it is not whole.
    """

    number: int
    batch: int
    point: Point
    encounters: int
    whole: bool
    score: Score

    @property
    def objectives(self) -> Objectives:
        """Harm and work lost."""
        return Objectives(self.score.harm, self.score.lost)

    @property
    def counts(self) -> bool:
        """Whether it may be on the front: whole, and every constraint kept."""
        return self.whole and self.score.violation == 0.0

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self._asdict() | {"score": self.score._asdict()}


def front_of(trials: Sequence[Trial]) -> list[Trial]:
    """The trials on the front, from little harm to little work lost."""
    among = [trial for trial in trials if trial.counts]
    return [among[k] for k in front([trial.objectives for trial in among])]


def played_to_dict(played: Played) -> dict[str, list[list[Any]]]:
    """For JSON."""
    return {str(lag): [list(outcome) for outcome in runs] for lag, runs in played.items()}
