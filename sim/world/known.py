"""What the robot's cell holds by plan: a scene's furniture as known obstacles; `furniture.py` has the way back."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sensing.hulls import Obstacle
from qpsafe.sim.world.scene import SCENERY, Scene

FLOOR = (6.0, 6.0, 0.5)  # the floor as a slab: as far as any spot could look, and thick [m]


def known_obstacles(scene: Scene) -> tuple[Obstacle, ...]:
    """The scenery's geoms as convex hulls: planes as slabs below them, boxes, meshes, cylinders as prisms around them.

    The geoms of a fixed body other than the world make one hull. What can move is not known.
    """
    model, kind = scene.model, mujoco.mjtGeom
    data = scene.make_data()
    found: list[Obstacle] = []
    bodies: dict[str, list[NDArray[np.float64]]] = {}
    for geom in np.flatnonzero(model.geom_group == SCENERY):
        body = model.geom_bodyid[geom]
        if model.body_weldid[body] != 0:
            continue
        name, size, shape = model.geom(geom).name, model.geom_size[geom], model.geom_type[geom]
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
        if shape == kind.mjGEOM_PLANE:
            pose[:3, 3] -= 0.5 * FLOOR[2] * pose[:3, 2]
            found.append(Obstacle.box(name, FLOOR, pose=pose))
        elif shape == kind.mjGEOM_BOX:
            box = Obstacle.box(name, 2.0 * size, pose=pose)
            if body == 0:
                found.append(box)
            else:
                bodies.setdefault(model.body(body).name, []).append(box.vertices)
        elif shape == kind.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            vertices = np.asarray(model.mesh_vert[first : first + count], dtype=float)
            found.append(Obstacle(name, vertices @ pose[:3, :3].T + pose[:3, 3]))
        elif shape == kind.mjGEOM_CYLINDER:
            angle = np.pi * np.arange(48) / 24
            outer = size[0] / np.cos(np.pi / 48)
            ring = np.stack((outer * np.cos(angle), outer * np.sin(angle)), axis=1)
            corners = np.vstack([np.column_stack((ring, np.full(48, z))) for z in (-size[1], size[1])])
            found.append(Obstacle(name, corners @ pose[:3, :3].T + pose[:3, 3]))
        else:
            raise ValueError(f"scenery geom {name} has no hull here: add its shape to sim/world/known.py")
    found.extend(Obstacle(name, np.vstack(vertices)) for name, vertices in bodies.items())
    return tuple(found)
