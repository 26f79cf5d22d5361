"""Rays of the distance sensors against the person and the board.

Only geometry group 1 is seen. The robot and the floor are transparent here: the source removes measurements of the
robot itself and of known surroundings in software, which is a filter of its own, not a property of the ray.

One `mj_ray` call a ray: for 20 rays that takes tens of microseconds, and it reads the poses that the plant and
`Scene.place_person` have just computed. `mujoco.batch.Batch.ray` casts thousands faster, but redoes the kinematics of a
state handed to it at every call.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.scene import PERSON, Scene

_SEEN = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
_SEEN[PERSON] = 1


def cast(
    scene: Scene,
    data: Any,
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    cutoff: float,
) -> NDArray[np.float64]:
    """Distances to the first surface of person or board along k rays.

    A ray that starts inside a part of the person meets its surface from inside.

    Args:
        scene: The scene.
        data: Its state, geom poses up to date.
        origins: World frame, (k, 3) [m].
        directions: World frame, of any length above 0, (k, 3).
        cutoff: Farther surfaces are not seen [m].

    Returns:
        (k,) distances [m], +inf where nothing lies within `cutoff`, NaN for a ray that is no ray (an origin or
        direction that is not finite, a direction of length 0): nothing is known about what it would meet.
    """
    lengths = np.sqrt((directions * directions).sum(axis=1))
    valid = np.isfinite(origins).all(axis=1) & np.isfinite(lengths) & (lengths > 0.0)
    hit = np.full(len(origins), np.nan)
    model, hit_geom = scene.model, np.empty(1, dtype=np.int32)
    for i in np.flatnonzero(valid):
        hit[i] = mujoco.mj_ray(model, data, origins[i], directions[i] / lengths[i], _SEEN, True, -1, hit_geom)
    hit[hit < 0.0] = np.inf  # MuJoCo's miss is -1
    hit[hit > cutoff] = np.inf
    return hit
