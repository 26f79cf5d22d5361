"""Capsules of the gate where a robot's model has no collision geometry: the links of its wire, see `LinkParts.wire`.

The gate wants every capsule fixed in one body. A link whose ends move with different bodies, and yet as one piece, lies
in that of its start: so it is with a joint at its end. Any other changes its length or direction in both, as where a
joint slides in between; it then is everything between its end and where its start can be, seen from the end's body.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.link_parts import LinkParts
from qpsafe.gate.capsules import Capsules, capsule_around
from qpsafe.sensing.detection import plausible

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

AS_ONE = 1e-9  # ends that keep their distance from each other so well are one piece [m]
_MOST = 2000  # configurations of the joints between the ends that are looked at


def wire_capsules(robot: Robot, bodies: Collection[int]) -> Capsules:
    """Capsules along the links of the robot's wire, with the radii of `LinkParts.wire`.

    Args:
        robot: The robot.
        bodies: Only those fixed in these; 0, which stands, approaches nobody.
    """
    parts = LinkParts.wire(robot)
    owners: list[int] = []
    names: list[str] = []
    ends: list[Array] = []
    radii: list[float] = []
    for name, (first, last), places, radius in zip(parts.names, parts.bodies, parts.ends, parts.radii, strict=True):
        starts, stops = _seen(robot, first, last, places)
        if np.ptp(stops, axis=0).max() <= AS_ONE:  # the start's body sees the end always at the same place
            body, axis, more = int(first), np.stack((places[0], stops[0])), 0.0
        else:
            body = int(last)
            axis, more = capsule_around(np.vstack((starts, places[1])))
        if body in bodies and (radius + more > 0.0 or np.ptp(axis, axis=0).max() > AS_ONE):
            owners.append(body)
            names.append(name)
            ends.append(axis)
            radii.append(float(radius) + more)
    thick = np.array(radii)
    return Capsules(np.array(owners, dtype=np.int64), tuple(names), np.array(ends).reshape(-1, 2, 3), thick, thick)


def _seen(robot: Robot, first: int, last: int, places: Array) -> tuple[Array, Array]:
    """Where the start is in the body of the end, and the end in that of the start, as joints go (k, 3) each [m]."""
    supports = robot.tree.supports
    between = np.flatnonzero(supports[first] != supports[last])
    count = max(int(_MOST ** (1.0 / max(len(between), 1))), 2)
    low, high, _, _ = plausible(robot)  # those that slide: wherever they are believed to be
    low, high = np.where(robot.sliding, low, robot.lower), np.where(robot.sliding, high, robot.upper)
    low, high = np.where(robot.endless, -np.pi, low), np.where(robot.endless, np.pi, high)
    starts, stops = [], []
    for values in product(*(np.linspace(low[j], high[j], count) for j in between)):
        q = robot.home.copy()
        q[between] = values
        poses = robot.at(q).body_poses()
        across = np.linalg.inv(poses[last]) @ poses[first]
        starts.append(across[:3, :3] @ places[0] + across[:3, 3])
        stops.append(across[:3, :3].T @ (places[1] - across[:3, 3]))
    return np.array(starts), np.array(stops)
