"""What happens in a trial, whoever controls the robot: what its seed, or a point of the cube, stands for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from qpsafe.sim.campaign.digests import State, state_of
from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.campaign.trials.station import Station, station

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.engine.tracks import PersonTracks
    from qpsafe.sim.stories.story import Story


class Case(Protocol):
    """An encounter that is not drawn from a seed, see `qpsafe.sim.campaign.worst.cases`."""

    @property
    def motion(self) -> str:
        """What the robot does."""

    @property
    def u(self) -> Sequence[float]:
        """Point of the unit cube of the people's model (d,)."""


class Meeting(NamedTuple):
    """A robot at its work, and people who come.

    Attributes:
        trial: Its number in the plan; -1 for one that is in none.
        seed: Of the sensors' noise.
        station: What the robot does where.
        story: What people do.
        tracks: The same, tick by tick.
    """

    trial: int
    seed: int
    station: Station
    story: Story
    tracks: PersonTracks


def meeting(plan: Plan, what: int | Case) -> Meeting:
    """What happens in a trial, or in a case that a search has found.

    Args:
        plan: The campaign.
        what: Number of a trial from 0, whose motion is the plan's, in turn; or a case.
    """
    model = _model(plan.people, state_of(plan.people))
    if isinstance(what, int | np.integer):
        trial = int(what)
        seed, motion = plan.seed_of(trial), plan.motions[trial % len(plan.motions)]
        u = model.random(seed)
    else:
        trial, seed, motion, u = -1, plan.seed, what.motion, np.array(what.u)
    place = station(plan.robot, motion, plan.lag, plan.sensor, plan.cell)
    story = model.encounter(u, place.floor_plan)
    assert story.duration is not None
    return Meeting(trial, seed, place, story, story.track(np.arange(0.0, story.duration, DT)))


@cache
def _model(people: str | None, state: State) -> EncounterModel:
    """Read once for each state of its files."""
    return EncounterModel.load(people)
