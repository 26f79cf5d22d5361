"""Distance sensors for an arm that has none: rings on every link that is long enough, looking outwards past the arm.

A first guess that lets an experiment run; `qpsafe place` chooses sensors by what they detect.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from qpsafe.placement.sight import SelfSight
from qpsafe.sensing.body import body_hulls
from qpsafe.sim.experiments.shared.home import Arm
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

WRIST = 3  # joints at the end of an arm whose links carry none; fewer where it has fewer than six
SHORT, LONG = 0.08, 0.25  # links shorter than that carry none; longer ones two rings [m]
BARE = 0.04  # from the wire, where there is no surface [m]
OFF = 0.005  # from the surface [m]
AROUND, CHOSEN = 12, 4  # places that are looked at in a ring, and sensors in it
SELF = 0.02  # share of random postures in which one may see the robot from close by
RANGE, CONE = (0.2, 0.8), 6.0  # as the bundled robots' sensors have it [m, deg]


class Place(NamedTuple):
    """A sensor: wire link, counted from 0, frame, position [m] and direction in the frame's axes."""

    link: int
    frame: str
    position: Array
    direction: Array


def skin_toml(robot: Robot) -> tuple[str, int]:
    """The text of a `spots.toml`, and how many sensors it has."""
    sight = SelfSight(robot, RANGE[0], RANGE[1], np.radians(CONE))
    places = [
        place
        for link in range(len(robot.wire_frames))
        for ring in _rings(robot, link)
        for place in _spread(sight, ring)
    ]
    lines = [
        f"# {len(places)} sensors that an experiment put on {json_text(robot.name)}, in rings on its",
        "# links: a first guess, to be replaced by what `qpsafe place` chooses, or by where yours are.",
        "",
        'sensor = "any that measures distance"',
        f"range_min = {RANGE[0]}    # [m]",
        f"range_max = {RANGE[1]}    # [m]",
        f"field_of_view = {CONE} # [deg] full angle of the cone it sees",
    ]
    for k, place in enumerate(places):
        lines += [
            "",
            "[[spot]]",
            f"name = {json_text(f'link {place.link + 1} {k + 1}')}",
            f"link = {place.link + 1}",
            f"frame = {json_text(place.frame)}",
            f"position = {_vector(place.position)}",
            f"direction = {_vector(place.direction)}",
        ]
    return "\n".join(lines) + "\n", len(places)


def _spread(sight: SelfSight, ring: list[Place]) -> list[Place]:
    """Those of a ring that do not look at the robot itself, as far from one another as can be."""
    places = np.array([place.position for place in ring]), np.array([place.direction for place in ring])
    left = np.flatnonzero(sight.clear(ring[0].frame, *places, SELF)).tolist()
    chosen = left[:1]
    while len(chosen) < min(CHOSEN, len(left)):
        chosen.append(max(left, key=lambda i: min(_apart(i, k) for k in chosen)))
    return [ring[i] for i in sorted(chosen)]


def _apart(i: int, k: int) -> int:
    """Places between two of a ring."""
    return min((i - k) % AROUND, (k - i) % AROUND)


def _rings(robot: Robot, link: int) -> list[list[Place]]:
    start = robot.wire_frames[link][0]
    body, there = robot.mounting(start)
    wire, pose = robot.wire(robot.home, np.zeros(robot.nq)), robot.pose(start, robot.home)
    to_frame = np.linalg.inv(pose)
    ends = np.stack((wire.starts[link], wire.ends[link])) @ to_frame[:3, :3].T + to_frame[:3, 3]
    axis = ends[1] - ends[0]
    length = float(np.linalg.norm(axis))
    if body == 0 or body in _wrists(robot) or length < SHORT:  # what stands endangers nobody
        return []
    axis /= length
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    up = np.cross(axis, across)
    hulls = [vertices for owner, _, vertices in body_hulls(robot) if owner == body]
    found = []
    for share in (0.25, 0.75) if length > LONG else (0.5,):
        centre, ring = ends[0] + share * length * axis, []
        for angle in 2.0 * np.pi * np.arange(AROUND) / AROUND:
            direction = np.cos(angle) * across + np.sin(angle) * up
            origin, ray = there[:3, :3] @ centre + there[:3, 3], there[:3, :3] @ direction
            far = max((_exit(vertices, origin, ray) for vertices in hulls), default=0.0) or BARE
            ring.append(Place(link, start, centre + (far + OFF) * direction, direction))
        found.append(ring)
    return found


def _wrists(robot: Robot) -> set[int]:
    """Bodies of every arm's wrist: it works close to tables, which a sensor there would take for danger."""
    arms = [Arm.of(robot, tool).joints for tool in robot.tool_frames]
    return {joint + 1 for joints in arms for joint in joints[len(joints) - min(WRIST, max(len(joints) - 3, 0)) :]}


def _exit(vertices: Array, origin: Array, ray: Array) -> float:
    """How far from an origin a ray leaves a hull [m]; 0 where it does not meet it."""
    try:
        planes = ConvexHull(vertices).equations  # a x + b <= 0 inside
    except QhullError:
        return 0.0
    rate, gap = planes[:, :3] @ ray, -(planes[:, :3] @ origin + planes[:, 3])
    with np.errstate(divide="ignore", invalid="ignore"):
        times = gap / rate
    leaves = float(np.min(times[rate > 1e-12], initial=np.inf))
    enters = float(np.max(times[rate < -1e-12], initial=-np.inf))
    outside = bool((gap[np.abs(rate) <= 1e-12] < 0.0).any())
    return leaves if not outside and leaves >= max(enters, 0.0) else 0.0


def _vector(values: Array) -> str:
    return "[" + ", ".join(f"{value + 0.0:.6f}" for value in np.round(values, 6)) + "]"
