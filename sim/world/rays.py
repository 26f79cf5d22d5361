"""Rays of the distance sensors against everything: person, board, floor, pedestal and the robot itself.

A spot's own body is left out: it cannot see what it is mounted on. What of the rest does not count is decided by
the controller's filters, as in the paper, not by the rays.

`cast` asks MuJoCo, one `mj_multiRay` call an origin, for rays of any kind; `SpotRays` reads the spots at every tick,
with the engine's rays. Both read the poses that the plant and `Scene.place_person` have just computed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.engine.spot_table import SpotTable
from qpsafe.sim.engine.tracks import people_of
from qpsafe.sim.engine.world import World
from qpsafe.sim.world.scene import PERSON, ROBOT_COLLISION, SCENERY, Scene

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState
    from qpsafe.sensing.skin.spots import SpotArray

Array = NDArray[np.float64]

EVERYTHING = (SCENERY, PERSON, ROBOT_COLLISION)  # geometry groups


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

    The compiled rays of the engine; `cast` is what tests compare them with.

    Args:
        scene: The scene.
        spots: The robot's spots.
    """

    def __init__(self, scene: Scene, spots: SpotArray) -> None:
        from qpsafe.sim.engine.spot_rays import SpotReader  # compiled when there are spots to be read

        self._scene, self._world = scene, World.of(scene, movable=True)
        self._reader = SpotReader(self._world, SpotTable.of(scene, spots))

    def distances(self, data: Any, state: RobotState, reach: Array | float | None = None) -> Array:
        """Distance read by every spot (k,) [m], +inf where nothing is within reach.

        Args:
            data: State of the scene, geom poses up to date.
            state: The robot in the same configuration.
            reach: Farther surfaces are not seen, by default the spots' range [m].
        """
        return self._reader.read(self._world.poses(state, data), people_of(self._scene, data), reach)[0]
