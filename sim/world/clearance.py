"""How near the arm comes to the cell's furniture: nothing in the controller keeps it away but its own path."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.world.scene import Scene
from qpsafe.sim.world.surroundings import SCENERY


class Furniture:
    """Tables, support and box of a scene: all fixed boxes but the pedestal's.

    Args:
        scene: Furnished by a cell.
    """

    def __init__(self, scene: Scene) -> None:
        model = scene.model
        fixed = (model.geom_group == SCENERY) & (model.body_weldid[model.geom_bodyid] == 0)
        boxes = np.flatnonzero(fixed & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX))
        self.geoms = np.array([g for g in boxes if not model.geom(g).name.startswith("pedestal")], np.intp)
        self._scene = scene

    def distance(self, data: Any) -> float:
        """Smallest distance of the robot's collision geoms to it [m], negative inside; geom poses up to date."""
        model, robot, boxes = self._scene.model, self._scene.robot_geoms, self.geoms
        local = data.geom_xpos[robot][:, None] - data.geom_xpos[boxes][None]  # (robot, boxes, 3)
        local = np.einsum("rbi,bij->rbj", local, data.geom_xmat[boxes].reshape(-1, 3, 3))
        outside = np.maximum(np.abs(local) - model.geom_size[boxes], 0.0)
        bounds: NDArray[np.float64] = np.sqrt((outside**2).sum(axis=2)) - model.geom_rbound[robot][:, None]
        best, points = np.inf, np.empty(6)
        for i in np.argsort(bounds, axis=None):
            r, b = divmod(int(i), len(boxes))
            if bounds[r, b] > max(best, 0.0):
                break
            best = min(best, mujoco.mj_geomDistance(model, data, robot[r], boxes[b], 100.0, points))
        return float(best)
