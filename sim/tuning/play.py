"""Values played through encounters: the pieces of work that processes take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import process_time
from typing import TYPE_CHECKING, NamedTuple

from qpsafe.sim.campaign.opponents.registry import Opponent
from qpsafe.sim.campaign.trials.measures import measures
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.campaign.trials.trial import recorded_by
from qpsafe.sim.tuning.objectives import Outcome
from qpsafe.sim.tuning.values import Values

if TYPE_CHECKING:
    from qpsafe.sim.campaign.opponents.registry import Controls
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.trials.station import Station

#: Names of the controllers that are made of values begin with it.
PREFIX = "values "
#: Controllers whose blocks for compiled code a station keeps.
KEPT = 64


class Piece(NamedTuple):
    """Some values, some encounters.

    Attributes:
        plan: Whose encounters; its lag is the servos'.
        encounters: Their numbers.
        values: Played one after the other in each.
    """

    plan: Plan
    encounters: tuple[int, ...]
    values: tuple[Values, ...]

    def __str__(self) -> str:
        return f"encounters {self.encounters[0]} to {self.encounters[-1]}"


#: Plays a piece: for each encounter, the outcome of each of the values. Deterministic, and possible to pickle.
PieceFunction = Callable[[Piece], list[list[Outcome]]]


def play_piece(piece: Piece) -> list[list[Outcome]]:
    """Outcomes of all values in each encounter of a piece."""
    found = []
    for number in piece.encounters:
        met = meeting(piece.plan, number)
        runs = []
        for values in piece.values:
            entry = controller_of(values)
            _forget(met.station)
            run = recorded_by(piece.plan, met, entry)
            runs.append(Outcome.of(measures(piece.plan, met, entry.name, run)))
        found.append(runs)
    return found


def timed(play: PieceFunction, numbered: tuple[int, Piece]) -> tuple[int, list[list[Outcome]], float]:
    """Play a numbered piece: its number, outcomes, and processor time [s], since pieces come back in any order.

    Args:
        play: Plays it.
        numbered: Number and piece.
    """
    number, piece = numbered
    begun = process_time()
    return number, play(piece), process_time() - begun


def controller_of(values: Values) -> Opponent:
    """The default controller, but for its values."""

    def make(station: Station) -> Controls:
        return station.controller(**values.parts(station.robot))

    return Opponent(PREFIX + repr(values), "SafetyController with these values", make)


def _forget(station: Station) -> None:
    """Drop the oldest blocks: a search makes hundreds of controllers."""
    mine = [name for name in station.packed if name.startswith(PREFIX)]
    for name in mine[:-KEPT]:
        del station.packed[name]


def lagged(plan: Plan, ticks: int) -> Plan:
    """The plan with servos that are late.

    Args:
        plan: The search's.
        ticks: Lag.
    """
    return replace(plan, lag=DT * ticks)


def pieces(plan: Plan, encounters: Sequence[int], values: Sequence[Values], size: int) -> list[Piece]:
    """Encounters in pieces of a size, whoever plays them.

    Args:
        plan: Whose.
        encounters: Their numbers.
        values: All of them in every piece.
        size: Encounters of a piece.
    """
    return [
        Piece(plan, tuple(encounters[first : first + size]), tuple(values)) for first in range(0, len(encounters), size)
    ]
