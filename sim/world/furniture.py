"""What a cell's file lists, put into a scene."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mujoco

from qpsafe.sensing.hulls import Obstacle
from qpsafe.sim.world.surroundings import SCENERY


def add_obstacles(spec: Any, obstacles: Iterable[Obstacle]) -> None:
    """Put known obstacles into a scene, as they are seen by sensors: convex hulls that stand still and push nothing.

    Args:
        spec: Of the scene.
        obstacles: In the world frame, which is the robot's base.
    """
    for k, obstacle in enumerate(obstacles):
        name = f"cell {k} {obstacle.name}"
        spec.add_mesh(name=name, uservert=obstacle.vertices.ravel().tolist())
        spec.worldbody.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, group=SCENERY, contype=0, conaffinity=0,
            rgba=[0.62, 0.56, 0.47, 1.0],
        )  # fmt: skip
