"""Distance sensors for an arm that has none: places in rings on its links, those that detect people best.

A first guess, by the simulation of `qpsafe place` in small; that command chooses on surfaces that somebody has named.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from qpsafe.errors import ConfigurationError
from qpsafe.placement.candidates import Candidates, node_pose
from qpsafe.placement.coverage import detected_pairs, greedy
from qpsafe.placement.sensors import Sensor
from qpsafe.placement.sight import SelfSight
from qpsafe.placement.spots_toml import spots_toml
from qpsafe.sensing.body import body_hulls
from qpsafe.sensing.skin.spot import Spot
from qpsafe.sensing.skin.spots import SpotArray
from qpsafe.sim.experiments.shared.home import Arm
from qpsafe.sim.placement.run import MonteCarlo
from qpsafe.sim.world.rays import SpotRays
from qpsafe.sim.world.scene import build_scene
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

WRIST = 3  # joints at the end of an arm whose links carry none; fewer where it has fewer than six
SHORT, LONG = 0.08, 0.25  # links shorter than that carry none; those that long are no wrist, whatever turns them [m]
APART = 0.15  # rings of a link, at most [m]
BARE = 0.04  # from the wire, where there is no surface [m]
OFF = 0.005  # from the surface [m]
AROUND = 12  # places that are looked at in a ring
TILTS = np.radians((0.0, 40.0, -40.0))  # of a sensor, towards the link's end and its start
SELF = 0.02  # share of random postures in which one may see the robot from close by
DENSE = 20 / 0.945  # sensors on a metre of arm, as the IRB 140 has them [1/m]
PAIRS = 600  # of robot and person at random, which decide
SENSOR = Sensor("any that measures distance")  # as the bundled robots' have it: 0.2 to 0.8 m, 6 degrees


def skin_toml(robot: Robot) -> tuple[str, int]:
    """The text of a `spots.toml`, and how many sensors it has.

    Args:
        robot: Loaded from a folder: what is simulated reads its file.
    """
    places = [spot for link in range(len(robot.wire_frames)) for spot in _places(robot, link)]
    places = _unobstructed(robot, places) if places else places
    if not places:
        return "", 0
    nodes = SpotArray.of(places)
    candidates = Candidates(
        nodes, APART, SENSOR, np.zeros(len(nodes), dtype=np.int64), np.ones((len(nodes), 1), dtype=np.bool_)
    )
    chosen, words = _best(robot, candidates)
    remark = (
        f"{len(chosen)} sensors that an experiment put on {json_text(robot.name)}, in rings on its links, {words}: a "
        "first guess, to be replaced by what `qpsafe place` chooses, or by where yours are."
    )
    return spots_toml(candidates, chosen, remark), len(chosen)


def _unobstructed(robot: Robot, places: list[Spot]) -> list[Spot]:
    """Those that see nothing at home where nobody is there: neither pedestal nor floor."""
    spots, scene = SpotArray.of(places), build_scene(robot, people=())
    seen = SpotRays(scene, spots).distances(scene.make_data(), robot.at(robot.home))
    return [spot for spot, distance in zip(places, seen, strict=True) if not distance <= SENSOR.range_max]


def _best(robot: Robot, candidates: Candidates) -> tuple[list[int], str]:
    """The places that detect most people together, and how they were found."""
    most = round(DENSE * sum(Arm.of(robot, tool).length for tool in robot.tool_frames))
    try:
        sample = MonteCarlo(robot, candidates).sample(PAIRS)
    except ConfigurationError:  # shapes that leave no room for anybody: as even as can be
        step = max(len(candidates) / most, 1.0)
        return [int(step * k) for k in range(int(len(candidates) / step))], "evenly"
    found = greedy(len(candidates), sample.node, detected_pairs(sample))
    gains = np.diff(found.value)[:most]
    chosen = found.order[:most][gains > 0.0].tolist()
    share = float(found.value[len(chosen)]) / PAIRS
    return chosen, f"where they detect {100 * share:.0f} % of {PAIRS} people at random around it"


def _places(robot: Robot, link: int) -> list[Spot]:
    """Where sensors may sit on a link of the wire, none of them looking at the robot itself."""
    start = robot.wire_frames[link][0]
    body, there = robot.mounting(start)
    wire, pose = robot.wire(robot.home, np.zeros(robot.nq)), robot.pose(start, robot.home)
    to_frame = np.linalg.inv(pose)
    ends = np.stack((wire.starts[link], wire.ends[link])) @ to_frame[:3, :3].T + to_frame[:3, 3]
    axis = ends[1] - ends[0]
    length = float(np.linalg.norm(axis))
    if body == 0 or length < (LONG if body in _wrists(robot) else SHORT):  # what stands endangers nobody
        return []
    axis /= length
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    up = np.cross(axis, across)
    hulls = [vertices for owner, _, vertices in body_hulls(robot) if owner == body]
    rings, positions, directions = max(round(length / APART), 1), [], []
    for share in (np.arange(rings) + 0.5) / rings:
        centre = ends[0] + share * length * axis
        for angle in 2.0 * np.pi * np.arange(AROUND) / AROUND:
            out = np.cos(angle) * across + np.sin(angle) * up
            origin = there[:3, :3] @ centre + there[:3, 3]
            far = max((_exit(vertices, origin, there[:3, :3] @ out) for vertices in hulls), default=0.0) or BARE
            for tilt in TILTS:
                directions.append(np.cos(tilt) * out + np.sin(tilt) * axis)
                positions.append(centre + (far + OFF) * out)
    at, ways = np.array(positions), np.array(directions)
    clear = SelfSight(robot, SENSOR.range_min, SENSOR.range_max, SENSOR.field_of_view).clear(start, at, ways, SELF)
    own = there[:3, :3]
    clear &= [
        not any(_exit(v, own @ p + there[:3, 3], own @ d) > 0.0 for v in hulls) for p, d in zip(at, ways, strict=True)
    ]
    poses = [node_pose(at[k], ways[k]) for k in np.flatnonzero(clear)]
    return [Spot(f"link {link + 1} {k + 1}", link, start, pose, *SENSOR[1:4]) for k, pose in enumerate(poses)]


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
