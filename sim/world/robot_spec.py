"""The robot's own file as a part of a MuJoCo world: geoms in the simulation's groups, held joints held."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

ROBOT_VISUAL, ROBOT_COLLISION = 2, 3  # geometry groups


def robot_spec(robot: Robot) -> Any:
    """The robot's file as a `mujoco.MjSpec`, whatever groups its author chose.

    What collides is in group 3, the rest in group 2; where nothing collides, everything is in group 3. Planes that
    belong to the file's world are left out: a world has its own floor.

    Raises:
        ValueError: MuJoCo cannot read the file.
    """
    spec = mujoco.MjSpec.from_file(str(robot.model_path))
    for geom in list(spec.worldbody.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
            spec.delete(geom)
    paired = {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}
    geoms = list(spec.geoms)
    solid = [bool(geom.contype or geom.conaffinity or (geom.name and geom.name in paired)) for geom in geoms]
    for geom, collides in zip(geoms, solid if any(solid) else [True] * len(geoms), strict=True):
        geom.group = ROBOT_COLLISION if collides else ROBOT_VISUAL
    references = {joint.name: float(joint.ref) for joint in spec.joints}
    for name, joint in robot.held.items():
        if name in references:
            value = joint.value - references[name] * (
                1.0 if joint.sliding or not spec.compiler.degree else np.pi / 180.0
            )
            lock = spec.add_equality(name=f"{name} held", type=mujoco.mjtEq.mjEQ_JOINT, name1=name)
            lock.data[:5] = value, 0.0, 0.0, 0.0, 0.0
    return spec


def shown_groups(model: Any) -> NDArray[np.uint8]:
    """Which groups a picture shows: what collides only where there is nothing to be looked at, (6,)."""
    return np.array([1, 1, 1, not (model.geom_group == ROBOT_VISUAL).any(), 0, 0], dtype=np.uint8)
