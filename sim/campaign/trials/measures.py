"""From a recorded run to its row: distances, sight, contact, work."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.opponents.registry import NOTHING, POINTS, opponent
from qpsafe.sim.campaign.trials.closest import closest, smallest
from qpsafe.sim.campaign.trials.contact import TOWARDS, Touch, described
from qpsafe.sim.campaign.trials.rows import COLUMNS
from qpsafe.sim.campaign.trials.sight import first_seen, person_of
from qpsafe.sim.campaign.trials.work import STANDS, work

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.trials.closest import Closest
    from qpsafe.sim.campaign.trials.meeting import Meeting
    from qpsafe.sim.campaign.trials.recording import Recording

Array = NDArray[np.float64]

FAR = 1.0  # what is farther away than this has no figure of its own [m]
#: What stands where a figure does not apply.
EMPTY: dict[str, Any] = {c.name: {int: 0, float: math.nan, bool: False, str: "none"}[c.kind] for c in COLUMNS}


def measures(plan: Plan, met: Meeting, name: str, run: Recording) -> dict[str, Any]:
    """The row of a run; its names are explained in `qpsafe.sim.campaign.trials.rows`.

    Args:
        plan: The campaign.
        met: The encounter.
        name: Of the controller, or of a policy that the registry does not know.
        run: Of it.
    """
    place, tracks = met.station, met.tracks
    near = closest(place, run.q, tracks, FAR)
    row = EMPTY | {
        "trial": met.trial, "seed": met.seed, "motion": place.motion, "controller": name,
        "sensor": _sensor(plan, name), "simulated": run.dt * len(run.q),
        "distance": float(near.distance.min()), "distance_time": run.dt * int(near.distance.argmin()),
    }  # fmt: skip
    row |= work(run, place)._asdict()
    row |= _sight(run, met, near)
    touching = np.flatnonzero(near.distance <= 0.0)
    if len(touching):
        k = max(int(touching[0]) - 1, 0)
        nearest = near.on_robot[k], near.on_person[k], int(near.body[k]), int(near.segment[k])
        touch = Touch(int(touching[0]), k, float(near.distance[k]), *nearest)
        row |= described(run, place, tracks, touch, run.points[k])
    pairs = place.distances
    furniture = min(smallest(place, run.q, pairs.furniture), smallest(place, run.q, pairs.floors))
    itself = smallest(place, run.q, pairs.own)
    row |= {"furniture": furniture <= 0.0, "furniture_distance": furniture}
    row |= {"self": itself <= 0.0, "self_distance": itself}
    row["search"] = badness(row)
    return row


def _sensor(plan: Plan, name: str) -> str:
    try:
        sight = opponent(name).sight
    except ValueError:  # a policy that nobody registered
        return plan.sensor
    return {POINTS: "perfect", NOTHING: "none"}.get(sight, plan.sensor)


def _sight(run: Recording, met: Meeting, near: Closest) -> dict[str, Any]:
    """First sight of anybody; whether whoever came below S_p first had been seen by then; time below S_p."""
    place, tracks = met.station, met.tracks
    below = near.distance < place.separation.distance(near.approach(place.robot, run.q, run.qd))
    touched = near.distance <= 0.0
    before = np.arange(len(touched)) < (int(touched.argmax()) if touched.any() else len(touched))
    under = below & before & (np.abs(run.qd).max(axis=1) > STANDS)
    owners = [k for k, person in enumerate(met.story.persons) if person.board is not None]
    seen = first_seen(run.points, tracks, owners)
    found: dict[str, Any] = {"under_sp": run.dt * int(under.sum()), "sight_in_time": True}
    if below.any():
        k = int(below.argmax())
        found["sight_in_time"] = seen[person_of(tracks, int(near.segment[k]), owners)] <= k
    first = min(seen)
    if first < len(run.q):
        distance = float(near.distance[first])
        found |= {"first_sight": run.dt * first}
        found |= {"first_sight_distance": distance if math.isfinite(distance) else math.nan}
    return found


def badness(row: dict[str, Any]) -> float:
    """Harm in one number, larger is worse: what a search maximises.

    Without contact it is minus the smallest distance [m]. A contact adds, from 0 on, s/(1 + s) of the energy's share s
    of its limit, and v/(v + 0.1 m/s) of the robot's speed v towards the person.
    """
    if not row["contact"]:
        return -float(row["distance"])
    share, speed = float(row["energy_share"]), max(float(row["towards_speed"]), 0.0)
    return share / (1.0 + share) + speed / (speed + TOWARDS)
