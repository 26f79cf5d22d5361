"""One trial: an encounter drawn from a seed, met by every controller; a row of measures for each.

Pure and deterministic: the same plan and number give the same rows in whatever process, beside whatever else.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.measures import measures
from qpsafe.sim.campaign.opponents.registry import opponent
from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.campaign.recording import DT, Observer, Recording, record
from qpsafe.sim.campaign.senses import Senses
from qpsafe.sim.campaign.station import Station, station

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.engine.tracks import PersonTracks
    from qpsafe.sim.stories.story import Story

Array = NDArray[np.float64]


class Encounter(NamedTuple):
    """What happens in a trial, whoever controls the robot.

    Attributes:
        trial: Its number in the plan.
        seed: Of people and noise.
        u: Point of the model's unit cube (d,).
        station: What the robot does where.
        story: What people do.
        tracks: The same, tick by tick.
    """

    trial: int
    seed: int
    u: Array
    station: Station
    story: Story
    tracks: PersonTracks


def encounter(plan: Plan, trial: int, u: Array | None = None) -> Encounter:
    """The encounter of a trial.

    Args:
        plan: The campaign.
        trial: Number from 0; its motion is the plan's, in turn.
        u: Another point of the cube than the trial's own, as the search for the worst has it.
    """
    place = station(plan.robot, plan.motions[trial % len(plan.motions)])
    seed, model = plan.seed_of(trial), _model(plan.people)
    u = model.random(seed) if u is None else u
    story = model.encounter(u, place.floor_plan)
    assert story.duration is not None
    return Encounter(trial, seed, u, place, story, story.track(np.arange(0.0, story.duration, DT)))


@cache
def _model(people: str | None) -> EncounterModel:
    return EncounterModel.load(people)


def run_trial(plan: Plan, trial: int) -> list[dict[str, Any]]:
    """Rows of all controllers of a plan in one of its trials.

    Args:
        plan: The campaign.
        trial: Number from 0.
    """
    met = encounter(plan, trial)
    return [measures(plan, met, name, recorded(plan, met, name)) for name in plan.controllers]


def recorded(plan: Plan, met: Encounter, name: str, observer: Observer | None = None) -> Recording:
    """The run of one controller in an encounter.

    Args:
        plan: The campaign.
        met: The encounter.
        name: Of the controller.
        observer: Called after every tick, see `record`.
    """
    senses = Senses(met.station, met.tracks, plan.sensor, met.seed)
    return record(met.station, opponent(name), senses, len(met.tracks), plan.lag, observer)
