"""From a recorded run to its row: distances, sight, contact, work."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.separation import Separation
from qpsafe.sim.campaign.closest import closest, smallest
from qpsafe.sim.campaign.contact import TOWARDS, Touch, described
from qpsafe.sim.campaign.opponents.registry import NOTHING, POINTS, opponent
from qpsafe.sim.campaign.rows import COLUMNS
from qpsafe.sim.campaign.work import STANDS, work

if TYPE_CHECKING:
    from qpsafe.sim.campaign.closest import Closest
    from qpsafe.sim.campaign.meeting import Meeting
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.recording import Recording
    from qpsafe.sim.campaign.station import Station

Array = NDArray[np.float64]

FAR = 1.0  # what is farther away than this has no figure of its own [m]
#: What stands where a figure does not apply.
EMPTY: dict[str, Any] = {c.name: {int: 0, float: math.nan, bool: False, str: "none"}[c.kind] for c in COLUMNS}


def measures(plan: Plan, met: Meeting, name: str, run: Recording) -> dict[str, Any]:
    """The row of a run; its names are explained in `qpsafe.sim.campaign.rows`.

    Args:
        plan: The campaign.
        met: The encounter.
        name: Of the controller, or of what is none of the registry's.
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
    row |= _sight(run, place, near)
    touching = np.flatnonzero(near.distance <= 0.0)
    if len(touching):
        k = max(int(touching[0]) - 1, 0)
        touch = Touch(k, float(near.distance[k]), near.on_robot[k], near.on_person[k], int(near.body[k]),
                      int(near.segment[k]))  # fmt: skip
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


def _sight(run: Recording, place: Station, near: Closest) -> dict[str, Any]:
    """First sight, and the protective separation distance S_p of each tick's approach."""
    separation = Separation(place.deceleration)
    needed = separation.distance(near.approach(place.robot, run.q, run.qd))
    moving = np.abs(run.qd).max(axis=1) > STANDS
    under = (near.distance < needed) & moving
    seen = np.array([len(points) > 0 for points in run.points])
    first = int(seen.argmax()) if seen.any() else len(seen)
    nearer = near.distance < needed
    too_near = int(nearer.argmax()) if nearer.any() else len(seen)
    found: dict[str, Any] = {"under_sp": run.dt * int(under.sum()), "sight_in_time": first <= too_near}
    if first < len(seen):
        found |= {"first_sight": run.dt * first, "first_sight_distance": float(near.distance[first])}
    return found


def badness(row: dict[str, Any]) -> float:
    """Harm in one number, larger is worse, without steps that a search could not climb.

    Without contact it is minus the smallest distance [m]. A contact counts from 0 on: the energy's share of its limit,
    bounded by 1, and the robot's speed towards the person, bounded by twice what counts as towards.
    """
    if not row["contact"]:
        return -float(row["distance"])
    speed = min(max(float(row["towards_speed"]), 0.0), 2.0 * TOWARDS) / (2.0 * TOWARDS)
    return min(float(row["energy_share"]), 1.0) + speed
