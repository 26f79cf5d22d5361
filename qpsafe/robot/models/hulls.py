"""The collision geometry of a model file as convex hulls on the robot's joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.robot.models import corners
from qpsafe.robot.models.collada import head_of
from qpsafe.robot.models.mjcf import Compiled

#: A hull of the body: the joint that moves it (0: none), its name, its vertices in that joint's frame (v, 3) [m].
BodyHull = tuple[int, str, NDArray[np.float64]]
_SHAPES = "a mesh, box, sphere, ellipsoid, capsule, cylinder"
_FLAT = 1e-6  # a mesh this thin, of its length, has no volume but what rounding gives it
_GRID = 1e-6  # MuJoCo keeps meshes in single precision: back to the micrometre [m]


def solid_geoms(model: Any) -> NDArray[np.bool_]:
    """Which geoms of a MuJoCo model are its body: those that collide; all of them where none does, (ngeom,)."""
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    collides[model.pair_geom1] = collides[model.pair_geom2] = True
    return collides | (not collides.any())


def hulls_of_mjcf(path: Path, compiled: Compiled, places: dict[int, tuple[int, Any]]) -> list[BodyHull]:
    """Hulls of the geoms that are the robot's body; those of the file's world, but for planes, are its base.

    Args:
        path: The file, for errors.
        compiled: The file.
        places: Of each body: the joint that moves it, and its placement on that.

    Raises:
        RobotFileError: A geom has no hull, e.g. a plane or a flat mesh.
    """
    import mujoco

    model, result, rotation = compiled.model, [], np.empty(9)
    plane = model.geom_type <= int(mujoco.mjtGeom.mjGEOM_HFIELD)
    own = np.isin(model.geom_bodyid, compiled.bodies) | ((model.geom_bodyid == 0) & ~plane)
    of_robot = np.flatnonzero(own & solid_geoms(model))
    if not len(of_robot):  # what collides is none of the robot's
        of_robot = np.flatnonzero(own)
    for geom in map(int, of_robot):
        body = int(model.geom_bodyid[geom])
        name = model.geom(geom).name or f"{compiled.body_names[body]}_{geom - model.body_geomadr[body]}"
        points = corners.of_geom(model, geom)
        if not len(points):
            kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
            raise RobotFileError(path, f"geom {name}", kind, _SHAPES)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        points = points @ rotation.reshape(3, 3).T + model.geom_pos[geom]
        if model.geom_dataid[geom] >= 0:
            points = np.round(points / _GRID) * _GRID
            mesh = model.mesh(int(model.geom_dataid[geom])).name
            _check_solid(path, f"geom {name}", mesh, points)
        joint, place = places[body]
        result.append((joint, name, points @ place.rotation.T + place.translation))
    return result


def hulls_of_pinocchio(path: Path, read: Callable[[], Any]) -> list[BodyHull]:
    """Hulls of pinocchio's collision geometry.

    Args:
        path: The file, for errors.
        read: Reads the geometry.

    Raises:
        RobotFileError: pinocchio cannot read it, or it has a shape that has no hull, e.g. a flat mesh.
    """
    try:
        geometry = read()
    except RobotFileError:
        raise
    except (ValueError, RuntimeError) as error:
        expected = f"one that pinocchio can read ({' '.join(str(error).split())})"
        raise RobotFileError(path, "collision geometry", path.name, expected) from error
    result = []
    for item in geometry.geometryObjects:
        points = corners.of_coal(item.geometry)
        if not len(points):
            raise RobotFileError(path, item.name, type(item.geometry).__name__, _SHAPES)
        if type(item.geometry).__name__.startswith(("BVHModel", "Convex")):
            where = f"link {item.name.rpartition('_')[0]}: collision mesh"
            points = points * head_of(path, where, Path(item.meshPath)).metres
            _check_solid(path, where, item.meshPath, points)
        placement = item.placement.homogeneous
        result.append((int(item.parentJoint), item.name, points @ placement[:3, :3].T + placement[:3, 3]))
    return result


def _check_solid(path: Path, where: str, mesh: str, points: NDArray[np.float64]) -> None:
    """Refuse a mesh with vertices that are not finite, and a flat one."""
    if not np.isfinite(points).all():
        raise RobotFileError(path, where, mesh, "a mesh whose vertices are finite numbers")
    size = np.ptp(points, axis=0).max()
    spread = np.linalg.svd((points - points.mean(axis=0)) / (size or 1.0), compute_uv=False)
    if not spread[-1] > _FLAT * spread[0] or len(points) < 4:
        raise RobotFileError(path, where, mesh, "a mesh that is not flat, but spans a volume")
