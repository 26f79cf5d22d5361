"""Rays of the distance sensors against everything: person, board, floor, pedestal and the robot itself.

A spot's own body is left out: it cannot see what it is mounted on. What of the rest does not count is decided by
the controller's filters, as in the paper, not by the rays.

One `mj_multiRay` call a spot: the rays of its cone start at one point. The poses that the plant and
`Scene.place_person` have just computed are read; `mujoco.batch.Batch.ray` casts thousands faster, but redoes the
kinematics of a state handed to it at every call.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.robot.names import name_in_file
from qpsafe.sensing.spots import rays_in_world
from qpsafe.sim.world.scene import PERSON, ROBOT_COLLISION, SCENERY, Scene

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState
    from qpsafe.sensing.spots import SpotArray

Array = NDArray[np.float64]

EVERYTHING = (SCENERY, PERSON, ROBOT_COLLISION)  # geometry groups
RING = 6  # rays on the mantle of a cone, besides its axis


def cast(
    scene: Scene,
    data: Any,
    origins: Array,
    directions: Array,
    cutoff: Array | float,
    *,
    groups: tuple[int, ...] = EVERYTHING,
    bodies: NDArray[np.intp] | None = None,
) -> Array:
    """Distances to the first surface along k rays.

    A ray that starts inside a body meets its surface from inside.

    Args:
        scene: The scene.
        data: Its state, geom poses up to date.
        origins: World frame, (k, 3) [m].
        directions: World frame, of any length above 0, (k, 3), or several from each origin (k, n, 3).
        cutoff: Farther surfaces are not seen, (k,) or one number [m].
        groups: Geometry groups that are seen.
        bodies: A body that each ray does not see, (k,), -1 for none.

    Returns:
        (k,) or (k, n) distances [m], +inf where nothing lies within `cutoff`, NaN for a ray that is no ray (an origin
        or direction that is not finite, a direction of length 0): nothing is known about what it would meet.
    """
    many = directions if directions.ndim == 3 else directions[:, None, :]
    k, n = many.shape[:2]
    lengths = np.sqrt((many * many).sum(axis=2))
    valid = np.asarray(np.isfinite(origins).all(axis=1))[:, None] & np.isfinite(lengths) & (lengths > 0.0)
    safe = np.where(valid[..., None], many, (0.0, 0.0, 1.0)) / np.where(valid, lengths, 1.0)[..., None]
    places = np.where(valid.any(axis=1)[:, None], origins, 0.0)
    seen = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
    seen[list(groups)] = 1
    hit, geom = np.empty((k, n)), np.empty(n, dtype=np.int32)
    limit = np.broadcast_to(np.asarray(cutoff, dtype=float), (k,))
    for i in range(k):
        exclude = -1 if bodies is None else int(bodies[i])
        mujoco.mj_multiRay(
            scene.model, data, places[i], safe[i].ravel(), seen, True, exclude, geom, hit[i], None, n, limit[i]
        )
    hit[hit < 0.0] = np.inf  # MuJoCo's miss is -1
    hit[hit > limit[:, None]] = np.inf
    hit[~valid] = np.nan
    return hit if directions.ndim == 3 else hit[:, 0]


class SpotRays:
    """What an ideal distance sensor of the given cone reads at every spot: the nearest surface in the cone.

    Args:
        scene: The scene.
        spots: The robot's spots.
    """

    def __init__(self, scene: Scene, spots: SpotArray) -> None:
        self._scene, self._spots = scene, spots
        self._bodies = np.array([_body(scene, frame) for frame in spots.frames], dtype=np.intp)
        self._mounting = spots.mounting(scene.robot)  # never changes, and takes longer than all that follows from it
        self._slant = np.tan(0.5 * spots.field_of_view)
        angle = 2.0 * np.pi * np.arange(RING) / RING
        self._circle = np.stack((np.cos(angle), np.sin(angle)), axis=1)  # (RING, 2)

    def distances(self, data: Any, state: RobotState, reach: Array | float | None = None) -> Array:
        """Distance read by every spot (k,) [m], +inf where nothing is within reach.

        Args:
            data: State of the scene, geom poses up to date.
            state: The robot in the same configuration.
            reach: Farther surfaces are not seen, by default the spots' range [m].
        """
        origins, axes = rays_in_world(state.body_poses(), *self._mounting)
        limit = self._spots.range_max if reach is None else reach
        x, y, z = axes.T
        zero = np.zeros(len(axes))
        # u = a × e / |a × e| with e the x axis, or the y axis where a is near x; v = a × u. np.cross takes far longer
        u = np.where(np.abs(axes[:, :1]) < 0.8, np.stack((zero, z, -y), axis=1), np.stack((-z, zero, x), axis=1))
        u /= np.sqrt((u * u).sum(axis=1))[:, None]
        v = np.stack((y * u[:, 2] - z * u[:, 1], z * u[:, 0] - x * u[:, 2], x * u[:, 1] - y * u[:, 0]), axis=1)
        basis = np.stack((u, v), axis=1)  # (k, 2, 3)
        mantle = axes[:, None, :] + self._slant[:, None, None] * (self._circle @ basis)
        rays = np.concatenate((axes[:, None, :], mantle), axis=1)
        return cast(self._scene, data, origins, rays, limit, bodies=self._bodies).min(axis=1)


def _body(scene: Scene, frame: str) -> int:
    """The MuJoCo body that a frame of the robot, or the joint that moves it, is fixed to; 0 for the world."""
    model, found = scene.model, scene.robot.model.frames[scene.robot.frame_id(frame)]
    name, kind = "robot/" + name_in_file(found.name), mujoco.mjtObj
    owners: list[tuple[Any, Any]] = [
        (kind.mjOBJ_SITE, model.site_bodyid),
        (kind.mjOBJ_BODY, np.arange(model.nbody)),
        (kind.mjOBJ_JOINT, model.jnt_bodyid),
    ]
    if found.name != name_in_file(found.name):  # a body, or a joint, whose name a site has too
        owners = owners[1:] if "(body" in found.name else owners[2:]
    for what, bodies in owners:
        index = mujoco.mj_name2id(model, what, name)
        if index >= 0:
            return int(bodies[index])
    return 0
