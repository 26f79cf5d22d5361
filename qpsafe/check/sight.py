"""Which spots see what stands in the cell by plan nearer than d_min on a path: there it counts as danger all the same.

A spot reads the nearest surface in its cone, which is looked into along its axis and along `RING` rays on its mantle.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sensing.hulls import Obstacle, half_spaces
from qpsafe.sensing.skin.spots import SpotArray, rays_in_world

if TYPE_CHECKING:
    from qpsafe.check.path import NominalPath
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

RING = 12
PERIOD = 0.02  # how often is looked [s]; a spot that sees a thing for less than that is gone before anything moves


class Sighting(NamedTuple):
    """A spot sees something of the cell nearer than d_min.

    Attributes:
        spot: Its name.
        obstacle: What it sees.
        distance: The smallest one it reads [m].
        time: When it does [s].
        total: For how long in all it reads less than d_min [s].
    """

    spot: str
    obstacle: str
    distance: float
    time: float
    total: float


def sightings(
    robot: Robot, path: NominalPath, spots: SpotArray, known: Sequence[Obstacle], d_min: float
) -> tuple[Sighting, ...]:
    """Spots that see known obstacles nearer than d_min, the nearest first.

    Args:
        robot: The robot.
        path: Where it goes.
        spots: Its distance sensors.
        known: What stands in the cell.
        d_min: Below which a reading always counts [m].
    """
    stride = max(1, round(PERIOD / path.step))
    bodies, rays = spots.mounting(robot)
    seen = [rays_in_world(poses, bodies, rays) for poses in path.poses[::stride]]
    if not seen or not len(spots) or not known:
        return ()
    origins, axes = (np.stack(part) for part in zip(*seen, strict=True))  # (m, k, 3)
    best, what = np.full(origins.shape[:2], np.inf), np.full(origins.shape[:2], -1)
    for number, thing in enumerate(known):
        low, high = thing.vertices.min(axis=0), thing.vertices.max(axis=0)
        away = origins - np.clip(origins, low, high)
        near = (away * away).sum(axis=-1) < d_min**2
        if not near.any():
            continue
        cones = fan(axes[near], spots.field_of_view[np.nonzero(near)[1]])
        found = ray_hull(origins[near][:, None], cones, half_spaces(thing.name, thing.vertices)).min(axis=1)
        nearer = found < best[near]
        best[near], what[near] = np.where(nearer, found, best[near]), np.where(nearer, number, what[near])
    times, length = path.times[::stride], stride * path.step
    result = []
    for i in np.flatnonzero((best < d_min).any(axis=0)):
        k = int(best[:, i].argmin())
        total = min(length * int((best[:, i] < d_min).sum()), float(path.times[-1]))
        name = known[int(what[k, i])].name
        result.append(Sighting(spots.names[i], name, float(best[k, i]), float(times[k]), total))
    return tuple(sorted(result, key=lambda sighting: sighting.distance))


def fan(axes: Array, angles: Array) -> Array:
    """Unit vectors in cones: the axis, and `RING` on the mantle, (m, RING + 1, 3).

    Args:
        axes: Unit vectors (m, 3).
        angles: Full opening angles (m,) [rad].
    """
    other = np.eye(3)[np.abs(axes).argmin(axis=1)]
    u = np.cross(axes, other)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v, turn = np.cross(axes, u), 2.0 * np.pi * np.arange(RING) / RING
    mantle = np.cos(turn)[:, None] * u[:, None] + np.sin(turn)[:, None] * v[:, None]
    half = 0.5 * angles[:, None, None]
    return np.concatenate((axes[:, None], np.cos(half) * axes[:, None] + np.sin(half) * mantle), axis=1)


def ray_hull(origins: Array, directions: Array, planes: Array) -> Array:
    """Distance along rays to a convex hull, 0 from inside, +inf where it is missed, (..., 3) -> (...).

    Args:
        origins: (..., 3) [m].
        directions: Unit vectors (..., 3).
        planes: Half-spaces n·x + b <= 0 of the hull (n, b), (p, 4).
    """
    height = origins @ planes[:, :3].T + planes[:, 3]  # above each face
    fall = -(directions @ planes[:, :3].T)  # towards it
    with np.errstate(divide="ignore", invalid="ignore"):
        at = height / fall
    # on a ray, n·x + b <= 0 holds from `at` on where it falls, up to `at` where it rises, always or never else
    enter = np.where(fall > 0.0, at, np.where((fall == 0.0) & (height > 0.0), np.inf, 0.0)).max(axis=-1)
    leave = np.where(fall < 0.0, at, np.inf).min(axis=-1)
    enter = np.maximum(enter, 0.0)
    result: Array = np.where(enter <= leave, enter, np.inf)
    return result
