"""Support points of convex shapes, compiled: the point of a shape's core that lies farthest in a direction."""

from __future__ import annotations

from math import copysign, sqrt

from qpsafe.compiled.compiled import Array, Vector, dot, inline, row
from qpsafe.geometry.layout import BOX, CAPSULE, CYLINDER, ELLIPSOID, KIND, MESH, SIZE, VERTEX, VERTICES
from qpsafe.robot.kinematics import Index

FEW = 12  # vertices that are looked through one by one


@inline
def _climbed(d: Vector, at: int, vertices: Array, starts: Index, neighbours: Index) -> int:
    """The farthest vertex of a hull, found by going from neighbour to neighbour."""
    value, higher = dot(row(vertices, at), d), at
    while higher >= 0:
        at, higher = higher, -1
        for k in range(starts[at], starts[at + 1]):
            x = dot(row(vertices, neighbours[k]), d)
            if x > value:
                value, higher = x, neighbours[k]
    return at


@inline
def _farthest(d: Vector, first: int, count: int, vertices: Array) -> int:
    """The farthest of all vertices of a hull."""
    at, value = first, dot(row(vertices, first), d)
    for k in range(first + 1, first + count):
        x = dot(row(vertices, k), d)
        if x > value:
            value, at = x, k
    return at


@inline
def support(
    kind: Index, shape: Array, d: Vector, at: int, careful: bool, vertices: Array, starts: Index, neighbours: Index
) -> tuple[Vector, int]:
    """The farthest point of a shape's core in direction d, shape's frame, and the vertex that it is.

    Where to begin is told by `at`, the vertex found before. Going from neighbour to neighbour may end a hair too early
    where faces are flat only to rounding: all vertices are looked at if `careful`.
    """
    k, a, b, c = kind[KIND], shape[SIZE], shape[SIZE + 1], shape[SIZE + 2]
    if k == MESH:
        if careful or kind[VERTICES] <= FEW:
            at = _farthest(d, kind[VERTEX], kind[VERTICES], vertices)
        else:
            at = _climbed(d, at, vertices, starts, neighbours)
        return row(vertices, at), at
    if k == BOX:
        return (copysign(a, d[0]), copysign(b, d[1]), copysign(c, d[2])), at
    if k == CAPSULE:
        return (0.0, 0.0, copysign(b, d[2])), at
    if k == CYLINDER:
        # sizes and directions of any magnitude: first to size 1
        most = max(abs(d[0]), abs(d[1]))
        if most == 0.0:
            return (0.0, 0.0, copysign(b, d[2])), at
        x, y = d[0] / most, d[1] / most
        s = a / sqrt(x * x + y * y)
        return (s * x, s * y, copysign(b, d[2])), at
    if k == ELLIPSOID:
        # the point where the gradient (x/a², y/b², z/c²) is along d
        x, y, z = a * d[0], b * d[1], c * d[2]
        most = max(abs(x), abs(y), abs(z))
        if most == 0.0:
            return (a, 0.0, 0.0), at
        x, y, z = x / most, y / most, z / most
        s = 1.0 / sqrt(x * x + y * y + z * z)
        return (s * a * x, s * b * y, s * c * z), at
    return (0.0, 0.0, 0.0), at  # the core of a sphere
