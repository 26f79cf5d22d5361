"""Contacts of a run: when and where, how the contact point moved one tick before, and how hard the contact was.

A contact begins at the first tick at which robot and person overlap; what is said of it is taken one tick before, where
the two surfaces still have a nearest pair of points and a direction between them. People do not give way: a run goes on
through a contact as if nothing had happened, and only the first one is described.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.trials.harm import blow, effective_mass
from qpsafe.sim.world.contact_point import contact_point
from qpsafe.sim.world.rays import cast
from qpsafe.sim.world.scene import ROBOT_COLLISION, SCENERY

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.recording import Recording
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.sim.engine.tracks import PersonTracks

Array = NDArray[np.float64]

MOVING, TOWARDS = 1e-3, 0.1  # speeds of the robot's contact point from which it moves, and moves towards somebody [m/s]
NEAR = 0.3  # a part counts as seen if it is this near to a point that is [m]
ROOM = 0.05  # a part with less room than this behind it is clamped [m]


class Touch(NamedTuple):
    """Nearest points of robot and people at one tick.

    Attributes:
        begin: First tick of the contact.
        k: The tick before it, or that tick itself if it is the first one of all.
        distance: At k [m].
        on_robot, on_person: (3,) [m].
        body: Of the robot, as in its tree.
        segment: Number of the capsule; from the number of capsules on, that of a board.
    """

    begin: int
    k: int
    distance: float
    on_robot: Array
    on_person: Array
    body: int
    segment: int


def described(run: Recording, station: Station, tracks: PersonTracks, before: Touch, seen: Array) -> dict[str, Any]:
    """What the row says of a contact.

    Args:
        run: Of a controller.
        station: Where it was.
        tracks: Everybody's capsules.
        before: Nearest points one tick before the contact.
        seen: Points that counted then (p, 3) [m].
    """
    robot, k = station.robot, before.k
    pair = before.on_robot, before.on_person
    point = contact_point(robot.at(run.q[k]), run.qd[k], before.body, pair, before.distance)
    (J, velocity, normal), towards = point, point.towards
    closing = towards - float(_velocity(tracks, k, before.segment, before.on_person) @ normal)
    clamped = towards > MOVING and _blocked(station, run.q[k], tracks, before, normal)
    region = part_name(tracks, before.segment)
    mass = effective_mass(robot, run.q[k], J, normal)
    hit = blow(region, closing, mass, clamped)
    speed = float(np.linalg.norm(velocity))
    near = bool(len(seen)) and float(np.linalg.norm(seen - before.on_person, axis=1).min()) <= NEAR
    return {
        "contact": True,
        "contact_time": before.begin * run.dt,
        "contact_class": classified(speed, towards, clamped),
        "contact_region": region,
        "contact_frame": station.body_name(before.body),
        "moving": speed > MOVING,
        "towards": towards > TOWARDS,
        "clamped": clamped,
        "towards_speed": towards,
        "robot_speed": speed,
        "closing_speed": closing,
        "near_seen": near,
        "energy": hit.energy,
        "energy_limit": hit.energy_limit,
        "energy_share": hit.energy / hit.energy_limit,
        "force": hit.force,
        "force_limit": hit.force_limit,
    }


def part_name(tracks: PersonTracks, segment: int) -> str:
    """Region of the body that a capsule belongs to, ``board`` for a board; ``none`` for none."""
    return "none" if segment < 0 else tracks.names[segment] if segment < len(tracks.names) else "board"


def _velocity(tracks: PersonTracks, k: int, segment: int, point: Array) -> Array:
    """Of the point of a capsule, or a board, that is at `point` at tick k, by its place one tick later (3,) [m/s]."""
    after, board = min(k + 1, len(tracks) - 1), segment - len(tracks.radii)
    if board >= 0:
        here, there = tracks.boards[k, board], tracks.boards[after, board]
        moved = there @ np.linalg.inv(here) @ np.append(point, 1.0)
        return np.asarray((moved[:3] - point) / tracks.dt)
    (a, b), (c, d) = tracks.ends[k, segment], tracks.ends[after, segment]
    axis = b - a
    share = min(max(float((point - a) @ axis) / max(float(axis @ axis), 1e-12), 0.0), 1.0)
    return np.asarray(((1.0 - share) * (c - a) + share * (d - b)) / tracks.dt)


def classified(speed: float, towards: float, clamped: bool) -> str:
    """``rest``, ``away``, ``sideways``, ``towards`` or ``clamped``, by what the robot does at the contact point.

    Args:
        speed: Of the point [m/s].
        towards: Its part towards the person [m/s].
        clamped: Whether the part has nowhere to go, and the point moves towards it.
    """
    if not speed > MOVING:
        return "rest"
    if clamped:
        return "clamped"
    if towards > TOWARDS:
        return "towards"
    return "away" if towards < -TOWARDS else "sideways"


def _blocked(station: Station, q: Array, tracks: PersonTracks, before: Touch, normal: Array) -> bool:
    """Whether scenery, or the robot itself, is right behind the touched part."""
    board = before.segment - len(tracks.radii)
    if board < 0:
        thickness = 2.0 * float(tracks.radii[before.segment])
    else:
        thickness = 2.0 * float(tracks.half_sizes[board].min())
    data = station.scene.make_data(q)
    reach = thickness + ROOM
    start = before.on_person + 1e-6 * normal
    hit = cast(station.scene, data, start[None], normal[None], reach, groups=(SCENERY, ROBOT_COLLISION))
    return bool(math.isfinite(hit[0]))
