"""The distance sensors of a robot in flat arrays: where they sit, what they do not see, how far and how wide."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.robot.models.names import name_in_file

if TYPE_CHECKING:
    from qpsafe.sensing.skin.spots import SpotArray
    from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class SpotTable(NamedTuple):
    """What compiled rays need of k spots.

    Attributes:
        bodies: Body of `robot.tree` that carries each spot, (k,).
        unseen: The scene's body that each spot sits on and does not see, (k,).
        rays: Origin and direction in the body's frame, homogeneous columns (k, 4, 2) [m].
        reaches: How far each looks, (k,) [m].
        slants: Tangent of half its cone, (k,).
    """

    bodies: Index
    unseen: Index
    rays: Array
    reaches: Array
    slants: Array

    @classmethod
    def of(cls, scene: Scene, spots: SpotArray, reach: ArrayLike | None = None) -> SpotTable:
        """Spots on the robot of a scene.

        Args:
            scene: The scene.
            spots: The robot's spots.
            reach: Farther surfaces are not seen, by default the spots' range, (k,) or one number [m].
        """
        bodies, rays = spots.mounting(scene.robot)
        return cls(
            bodies.astype(np.int64),
            np.array([scene_body(scene, frame) for frame in spots.frames], dtype=np.int64),
            np.ascontiguousarray(rays),
            np.full(len(spots), spots.range_max if reach is None else reach, dtype=np.float64),
            np.tan(0.5 * spots.field_of_view),
        )


def scene_body(scene: Scene, frame: str) -> int:
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
