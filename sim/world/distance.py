"""The smallest true distance between the robot and the board or the person.

Pairs are sorted by a cheap lower bound (bounding sphere of the robot's geom against the exact box or capsule) and
handed to `mj_geomDistance` in that order until the bound exceeds the best distance found.

`mj_geomDistance` of MuJoCo 4.0 was compared with coal over 3000 random poses of each pair of shapes: separated shapes
agree to 2e-10 m (box, capsule, cylinder, sphere, convex mesh against box and capsule). Of shapes that overlap, the sign
is right but the depth of a capsule in a box can be too small.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]
Ids = NDArray[np.integer]


class Distance(NamedTuple):
    """A smallest distance and where it is.

    Attributes:
        distance: Negative when the two overlap [m].
        on_robot: Nearest point of the robot, world frame, (3,) [m].
        on_other: Nearest point of the board or the person, (3,) [m].
    """

    distance: float
    on_robot: Array
    on_other: Array


def board_distance(scene: Scene, data: Any) -> Distance:
    """Smallest distance of the robot's collision geoms to a board, +inf without one; `data` is up to date."""
    found = [_board_distance(scene, data, int(board)) for board in scene.board_geoms]
    return min(found, key=lambda item: item.distance) if found else Distance(np.inf, *np.full((2, 3), np.nan))


def _board_distance(scene: Scene, data: Any, board: int) -> Distance:
    centres = data.geom_xpos[scene.robot_geoms]
    # in the board's frame, the vector from the box to a point is what remains after clamping it into the box
    local = (centres - data.geom_xpos[board]) @ data.geom_xmat[board].reshape(3, 3)
    outside = np.maximum(np.abs(local) - scene.model.geom_size[board], 0.0)
    bounds = np.sqrt((outside * outside).sum(axis=1)) - scene.model.geom_rbound[scene.robot_geoms]
    return _smallest(scene.model, data, scene.robot_geoms, np.array([board]), bounds[:, None])


def person_distance(scene: Scene, data: Any) -> Distance:
    """Smallest distance of the robot's collision geoms to anybody's body, without the boards."""
    model, robot, person = scene.model, scene.robot_geoms, scene.person_geoms
    radii, halves = model.geom_size[person, 0], model.geom_size[person, 1]
    axes = data.geom_xmat[person].reshape(-1, 3, 3)[:, :, 2]
    offsets = data.geom_xpos[robot][:, None] - data.geom_xpos[person][None]  # (robot, person, 3)
    along = np.clip((offsets * axes).sum(axis=2), -halves, halves)
    offsets -= along[:, :, None] * axes
    bounds = np.sqrt((offsets * offsets).sum(axis=2)) - radii - model.geom_rbound[robot][:, None]
    return _smallest(model, data, robot, person, bounds)


def _smallest(model: Any, data: Any, robot: Ids, other: Ids, bounds: Array) -> Distance:
    """Smallest distance over all pairs of k and m geoms, given lower bounds of theirs (k, m)."""
    best, points, segment = np.inf, np.full(6, np.nan), np.empty(6)
    flat = bounds.ravel()
    for i in np.argsort(flat):
        # once something overlaps, any pair whose bounds overlap may be the deepest
        if flat[i] > max(best, 0.0):
            break
        pair = robot[i // len(other)], other[i % len(other)]
        distance = mujoco.mj_geomDistance(model, data, *pair, 100.0, segment)
        if distance < best:
            best, points = distance, segment.copy()
    return Distance(float(best), points[:3], points[3:])
