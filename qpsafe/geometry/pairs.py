"""The smallest distance over a list of pairs of shapes, compiled, and what else measures shapes on moving bodies.

Balls around shapes bound their distances from below. The pair of the smallest bound is measured first, then every pair
whose bound is below the smallest distance found. Where something overlaps, all pairs whose bounds are negative are
measured, so that the order of shapes never matters.
"""

from __future__ import annotations

from math import inf, isfinite, nan, sqrt

from numba import types

from qpsafe.compiled.compiled import Array, Vector, add, dot, entry, inline, linked, row
from qpsafe.compiled.memory import view
from qpsafe.geometry import separation as separations
from qpsafe.geometry.layout import BALL, BODY, CASE, FLOATS, KIND, PLANE
from qpsafe.geometry.separation import WORK, hull_types, separation
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, place

_separation = linked(separation, *separations.USES)

USES = (kinematics, *separations.USES, separations)
PAIR = 43 + FLOATS + WORK  # numbers that one pair is measured in

_pairs = types.Array(types.int64, 2, "C", readonly=True)
_two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (2, 3))


@inline
def pose_of(T: Array, shape: Array, pose: Array) -> None:
    """Pose (12,) in the world of a shape that is carried by a body at T."""
    for i in range(3):
        for j in range(4):
            value = T[i, 0] * shape[j] + T[i, 1] * shape[4 + j] + T[i, 2] * shape[8 + j]
            pose[4 * i + j] = value + (T[i, 3] if j == 3 else 0.0)


@inline
def _relative(A: Array, B: Array, T: Array) -> None:
    """Pose T (12,) of a frame at B in a frame at A."""
    x, y, z = B[3] - A[3], B[7] - A[7], B[11] - A[11]
    for i in range(3):
        for j in range(3):
            T[4 * i + j] = A[i] * B[j] + A[4 + i] * B[4 + j] + A[8 + i] * B[8 + j]
        T[4 * i + 3] = A[i] * x + A[4 + i] * y + A[8 + i] * z


@inline
def measured(
    A: Array, kind: Index, shape: Array, B: Array, other: Index, others: Array, vertices: Array, starts: Index,
    neighbours: Index, planes: Array, limit: float, work: Array, found: Array,
) -> float:  # fmt: skip
    """Distance of two shapes at A and B, +inf if it is larger than `limit`; else distance and points into `found`."""
    T, rest = view(work, 0, (12,)), view(work, 12, (WORK,))
    _relative(A, B, T)
    distance = _separation(kind, shape, other, others, T, vertices, starts, neighbours, planes, limit, rest)
    if distance < inf:
        found[0] = distance
        for side in range(2):
            x, y, z = rest[3 * side], rest[3 * side + 1], rest[3 * side + 2]
            for i in range(3):
                found[1 + 3 * side + i] = A[4 * i] * x + A[4 * i + 1] * y + A[4 * i + 2] * z + A[4 * i + 3]
    return distance


@inline
def ball_of(T: Array, shape: Array) -> Vector:
    """Centre in the world of the ball around a shape that is carried by a body at T."""
    return place(T, shape[BALL], shape[BALL + 1], shape[BALL + 2])


@inline
def beyond(A: Array, shape: Array, c: Vector, r: float) -> float:
    """How far a ball (c, r) is from the box around a shape at A, not less than -r."""
    x, y, z = c[0] - A[3], c[1] - A[7], c[2] - A[11]
    away = 0.0
    for i in range(3):
        u = A[i] * x + A[4 + i] * y + A[8 + i] * z - shape[CASE + i]
        u = max(abs(u) - shape[CASE + 3 + i], 0.0)
        away += u * u
    return sqrt(away) - r


@entry(
    types.int64(
        _three, _pairs,
        _pairs, _two, *hull_types,
        types.float64, types.float64[::1], types.float64[::1],
    ),
    *USES,
)  # fmt: skip
def nearest_pair(
    poses: Array,
    pairs: Index,
    index: Index,
    shapes: Array,
    vertices: Array,
    starts: Index,
    neighbours: Index,
    planes: Array,
    at_most: float,
    work: Array,
    found: Array,
) -> int:
    """The nearest of some pairs of shapes of the world: its number, -1 if none is nearer than `at_most`.

    Args:
        poses: Of the world's bodies, (b, 4, 4).
        pairs: Numbers of shapes, (m, 2); only the second may be a plane.
        index, shapes, vertices, starts, neighbours, planes: The world, see `World.solid`.
        at_most: Larger distances are not looked for [m].
        work: At least PAIR + 3 g + m numbers, for g shapes.
        found: Filled with the distance (+inf if none, NaN if a pose is not finite) and the nearest points, (7,) [m].
    """
    count = pairs.shape[0]
    A, B, globes = view(work, 0, (12,)), view(work, 12, (12,)), view(work, PAIR, (index.shape[0], 3))
    bounds = view(work, PAIR + 3 * index.shape[0], (count,))
    for i in range(index.shape[0]):
        globes[i, 0], globes[i, 1], globes[i, 2] = ball_of(poses[index[i, BODY]], shapes[i])
    first, least = -1, inf
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        c, r = row(globes, i), shapes[i, BALL + 3]
        if not isfinite(dot(c, c)):
            found[0] = nan
            return -1
        if index[j, KIND] == PLANE:
            pose_of(poses[index[j, BODY]], shapes[j], B)
            bound = B[2] * (c[0] - B[3]) + B[6] * (c[1] - B[7]) + B[10] * (c[2] - B[11]) - r
        else:
            c = add(c, -1.0, row(globes, j))
            bound = sqrt(dot(c, c)) - r - shapes[j, BALL + 3]
        bounds[p] = bound
        if bound < least:
            first, least = p, bound
    found[0] = inf
    nearest, best = -1, at_most
    for k in range(-1, count):
        p = first if k < 0 else k
        reach = max(best, 0.0)
        if p < 0 or k == first or bounds[p] > reach:
            continue
        i, j = pairs[p, 0], pairs[p, 1]
        pose_of(poses[index[i, BODY]], shapes[i], A)
        pose_of(poses[index[j, BODY]], shapes[j], B)
        if index[j, KIND] != PLANE and (
            beyond(A, shapes[i], row(globes, j), shapes[j, BALL + 3]) > reach
            or beyond(B, shapes[j], row(globes, i), shapes[i, BALL + 3]) > reach
        ):
            continue
        distance = measured(
            A, index[i], shapes[i], B, index[j], shapes[j], vertices, starts, neighbours, planes, reach,
            view(work, 24, (12 + WORK,)), view(work, 24 + 12 + WORK, (7,)),
        )  # fmt: skip
        if distance < best:
            best, nearest = distance, p
            for m in range(7):
                found[m] = work[36 + WORK + m]
    return nearest
