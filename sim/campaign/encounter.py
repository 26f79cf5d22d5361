"""What happens in a trial, whoever controls the robot: what its seed, or a point of the cube, stands for."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.campaign.recording import DT
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
