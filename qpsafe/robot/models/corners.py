"""Convex bodies as vertices whose hull contains them; round ones are slightly enlarged."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
_ROUND = 24  # corners of the polygons that stand for circles


def box(half: ArrayLike) -> Array:
    """A box of half edge lengths (3,), (8, 3)."""
    return np.array(list(product((-1.0, 1.0), repeat=3))) * np.asarray(half, dtype=float)


def ellipsoid(radii: ArrayLike) -> Array:
    """An ellipsoid of three radii, or a ball of one: polygons at several latitudes and the poles."""
    latitudes = np.pi * (np.arange(1, _ROUND // 2) / (_ROUND // 2) - 0.5)
    outer = 1.0 / np.cos(np.pi / _ROUND)
    rings = [_ring(outer * np.cos(a), outer * np.sin(a)) for a in latitudes]
    return np.asarray(radii, dtype=float) * np.vstack([*rings, [[0.0, 0.0, outer], [0.0, 0.0, -outer]]])


def capsule(radius: float, half: float) -> Array:
    """A capsule along z whose cylinder has a half length."""
    offset = np.array([0.0, 0.0, half])
    return np.vstack((ellipsoid(radius) + offset, ellipsoid(radius) - offset))


def cylinder(radius: float, half: float) -> Array:
    """A cylinder along z of a half length."""
    return np.vstack([_ring(radius, z) for z in (-half, half)])


def of_coal(shape: Any) -> Array:
    """A shape of coal; (0, 3) where it is of no kind that is known here. Meshes come with their scale applied."""
    kind = type(shape).__name__
    if kind.startswith("Convex"):
        return np.array(shape.points(), dtype=float)
    if kind.startswith("BVHModel"):
        return np.array(shape.vertices(), dtype=float)
    if kind == "Box":
        return box(shape.halfSide)
    if kind == "Sphere":
        return ellipsoid(shape.radius)
    if kind == "Capsule":
        return capsule(shape.radius, shape.halfLength)
    if kind == "Cylinder":
        return cylinder(shape.radius, shape.halfLength)
    return np.zeros((0, 3))


def of_geom(model: Any, geom: int) -> Array:
    """A geom of a compiled MuJoCo model, in its own frame; (0, 3) for planes and height fields."""
    import mujoco

    kind, size, kinds = int(model.geom_type[geom]), model.geom_size[geom], mujoco.mjtGeom
    if kind in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF):
        mesh = model.geom_dataid[geom]
        start = model.mesh_vertadr[mesh]
        return np.array(model.mesh_vert[start : start + model.mesh_vertnum[mesh]], dtype=float)
    if kind == kinds.mjGEOM_BOX:
        return box(size)
    if kind == kinds.mjGEOM_SPHERE:
        return ellipsoid(size[0])
    if kind == kinds.mjGEOM_ELLIPSOID:
        return ellipsoid(size)
    if kind == kinds.mjGEOM_CAPSULE:
        return capsule(size[0], size[1])
    if kind == kinds.mjGEOM_CYLINDER:
        return cylinder(size[0], size[1])
    return np.zeros((0, 3))


def _ring(radius: float, z: float) -> Array:
    """A regular polygon around a circle."""
    angle = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    outer = radius / np.cos(np.pi / _ROUND)
    return np.stack((outer * np.cos(angle), outer * np.sin(angle), np.full(_ROUND, z)), axis=1)
