"""One trial: an encounter drawn from a seed, met by every controller; a row of measures for each.

Pure and deterministic: the same plan and number give the same rows in whatever process, beside whatever else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from qpsafe.sim.campaign.opponents.registry import POINTS, SPOTS, opponent
from qpsafe.sim.campaign.trials.measures import measures
from qpsafe.sim.campaign.trials.meeting import Case, Meeting, meeting
from qpsafe.sim.campaign.trials.play import play
from qpsafe.sim.campaign.trials.recording import Observer, Recording, record
from qpsafe.sim.campaign.trials.senses import Senses

if TYPE_CHECKING:
    from qpsafe.sim.campaign.opponents.registry import Opponent
    from qpsafe.sim.campaign.plan import Plan

PERFECT_SIGHT = "perfect"  # the plan's sensor that tells everybody where people are


def run_trial(plan: Plan, trial: int) -> list[dict[str, Any]]:
    """Rows of all controllers of a plan in one of its trials.

    Args:
        plan: The campaign.
        trial: Number from 0.
    """
    met = meeting(plan, trial)
    return [measures(plan, met, name, recorded(plan, met, name)) for name in plan.controllers]


def run_case(plan: Plan, case: Case, controller: str) -> dict[str, Any]:
    """The row of one controller in an encounter that is not drawn from a seed.

    Args:
        plan: The campaign.
        case: Motion and point of the people's cube.
        controller: Its name.
    """
    met = meeting(plan, case)
    return measures(plan, met, controller, recorded(plan, met, controller))


def recorded(plan: Plan, met: Meeting, name: str, observer: Observer | None = None) -> Recording:
    """The run of one controller in an encounter.

    Args:
        plan: The campaign.
        met: The encounter.
        name: Of the controller.
        observer: Called after every tick, see `record`; then nothing is compiled as a whole.
    """
    return recorded_by(plan, met, opponent(name), observer)


def recorded_by(plan: Plan, met: Meeting, entry: Opponent, observer: Observer | None = None) -> Recording:
    """The run of a controller that need not be one of the registry's.

    Args:
        plan: The campaign.
        met: The encounter.
        entry: The controller.
        observer: See `recorded`.
    """
    senses = Senses(met.station, met.tracks, plan.sensor, met.seed)
    if plan.sensor == PERFECT_SIGHT and entry.sight == SPOTS:
        entry = entry._replace(sight=POINTS)
    ticks = len(met.tracks)
    quick = play(met.station, entry, senses, ticks, plan.lag) if observer is None else None
    return record(met.station, entry, senses, ticks, plan.lag, observer) if quick is None else quick
