"""The smallest of many distances, compiled: robot to people, and over a list of pairs of shapes.

Balls around shapes bound their distances from below. The pair of the smallest bound is measured first, then every pair
whose bound is below the smallest distance found. Where something overlaps, all pairs whose bounds are negative are
measured, so that the order of shapes never matters.
"""

from __future__ import annotations

from math import inf, isfinite, nan, sqrt

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, Vector, add, dot, entry, inline, linked, row
from qpsafe.compiled.memory import view
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, place
from qpsafe.sim.engine import separation as separations
from qpsafe.sim.engine.layout import BALL, BODY, BOX, CAPSULE, CASE, FLOATS, INTEGERS, KIND, MARGIN, PLANE, SIZE
from qpsafe.sim.engine.separation import WORK, hull_types, separation

_separation = linked(separation, *separations.USES)
_CAPSULE = np.array([CAPSULE] + [0] * (INTEGERS - 1), dtype=np.int64)  # what people are made of
_BOX = np.array([BOX] + [0] * (INTEGERS - 1), dtype=np.int64)

USES = (kinematics, *separations.USES, separations)
PAIR = 43 + FLOATS + WORK  # numbers that one pair is measured in

_ints, _pairs = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 2, "C", readonly=True)
_one, _two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))


@inline
def _pose_of(T: Array, shape: Array, pose: Array) -> None:
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
def _measured(
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
def _ball_of(T: Array, shape: Array) -> Vector:
    return place(T, shape[BALL], shape[BALL + 1], shape[BALL + 2])


@inline
def _beyond(A: Array, shape: Array, c: Vector, r: float) -> float:
    """How far a ball (c, r) is from the box around a shape at A, not less than -r."""
    x, y, z = c[0] - A[3], c[1] - A[7], c[2] - A[11]
    away = 0.0
    for i in range(3):
        u = A[i] * x + A[4 + i] * y + A[8 + i] * z - shape[CASE + i]
        u = max(abs(u) - shape[CASE + 3 + i], 0.0)
        away += u * u
    return sqrt(away) - r


@inline
def _capsule(ends: Array, radius: float, pose: Array, size: Array) -> None:
    """Pose (12,) and sizes of a person's capsule; of its frame only the third axis is needed."""
    e = add(row(ends, 1), -1.0, row(ends, 0))
    length = sqrt(dot(e, e))
    s = 1.0 / length if length > 0.0 else 0.0
    for k in range(3):
        pose[4 * k] = pose[4 * k + 1] = 0.0
        pose[4 * k + 2], pose[4 * k + 3] = s * e[k], 0.5 * (ends[0, k] + ends[1, k])
    size[SIZE], size[SIZE + 1], size[MARGIN] = radius, 0.5 * length, radius


@inline
def _board(T: Array, half_sizes: Array, b: int, pose: Array, size: Array) -> None:
    """Pose (12,) and sizes of a board."""
    for i in range(3):
        for j in range(4):
            pose[4 * i + j] = T[i, j]
        size[SIZE + i] = size[CASE + 3 + i] = half_sizes[b, i]
    size[MARGIN] = 0.0


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
        globes[i, 0], globes[i, 1], globes[i, 2] = _ball_of(poses[index[i, BODY]], shapes[i])
    first, least = -1, inf
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        c, r = row(globes, i), shapes[i, BALL + 3]
        if not isfinite(dot(c, c)):
            found[0] = nan
            return -1
        if index[j, KIND] == PLANE:
            _pose_of(poses[index[j, BODY]], shapes[j], B)
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
        _pose_of(poses[index[i, BODY]], shapes[i], A)
        _pose_of(poses[index[j, BODY]], shapes[j], B)
        if index[j, KIND] != PLANE and (
            _beyond(A, shapes[i], row(globes, j), shapes[j, BALL + 3]) > reach
            or _beyond(B, shapes[j], row(globes, i), shapes[i, BALL + 3]) > reach
        ):
            continue
        distance = _measured(
            A, index[i], shapes[i], B, index[j], shapes[j], vertices, starts, neighbours, planes, reach,
            view(work, 24, (12 + WORK,)), view(work, 24 + 12 + WORK, (7,)),
        )  # fmt: skip
        if distance < best:
            best, nearest = distance, p
            for m in range(7):
                found[m] = work[36 + WORK + m]
    return nearest


@entry(
    types.UniTuple(types.int64, 2)(
        _three, _ints,
        _pairs, _two, *hull_types,
        _three, _one, _two, _three, _two,
        types.float64, types.float64[::1], types.float64[::1],
    ),
    *USES,
)  # fmt: skip
def robot_to_people(
    poses: Array,
    robot: Index,
    index: Index,
    shapes: Array,
    vertices: Array,
    starts: Index,
    neighbours: Index,
    planes: Array,
    ends: Array,
    radii: Array,
    balls: Array,
    boards: Array,
    half_sizes: Array,
    at_most: float,
    work: Array,
    found: Array,
) -> tuple[int, int]:
    """The smallest distance of some shapes of the world to people: the shape and the number of a capsule, or of a
    board from the number of capsules on; (-1, -1) if nothing is nearer than `at_most`.

    Args:
        poses: Of the world's bodies, (b, 4, 4).
        robot: Numbers of the shapes, such as `World.robot`, (r,).
        index, shapes, vertices, starts, neighbours, planes: The world, see `World.solid`.
        ends, radii, balls, boards, half_sizes: People, see `PersonTracks.row`; no boards measures bodies only.
        at_most: Larger distances are not looked for [m].
        work: At least PAIR + r (s + b) numbers.
        found: Filled with the distance (+inf if none, NaN if a pose is not finite) and the nearest points, (7,) [m].
    """
    segments, people, other = radii.shape[0], balls.shape[0], radii.shape[0] + boards.shape[0]
    each = segments // people if people else 0
    A, B, size = view(work, 0, (12,)), view(work, 12, (12,)), view(work, 24 + 12 + WORK + 7, (FLOATS,))
    for m in range(FLOATS):
        size[m] = 0.0
    bounds = view(work, PAIR, (robot.shape[0], other))
    first, least = -1, inf
    for g in range(robot.shape[0]):
        i = robot[g]
        c, r = _ball_of(poses[index[i, BODY]], shapes[i]), shapes[i, BALL + 3]
        if not isfinite(dot(c, c)):
            found[0] = nan
            return -1, -1
        for p in range(people):
            away = add(c, -1.0, row(balls, p))
            far = sqrt(dot(away, away)) - balls[p, 3] - r > at_most
            for j in range(each * p, each * (p + 1)):
                bound = inf
                if not far:
                    start = row(ends[j], 0)
                    e, away = add(row(ends[j], 1), -1.0, start), add(c, -1.0, start)
                    ee = dot(e, e)
                    t = min(max(dot(away, e) / ee, 0.0), 1.0) if ee > 0.0 else 0.0
                    away = add(away, -t, e)
                    bound = sqrt(dot(away, away)) - radii[j] - r
                bounds[g, j] = bound
                if bound < least:
                    first, least = other * g + j, bound
        for b in range(boards.shape[0]):
            _board(boards[b], half_sizes, b, B, size)
            bound = _beyond(B, size, c, r)
            bounds[g, segments + b] = bound
            if bound < least:
                first, least = other * g + segments + b, bound
    found[0] = inf
    near, nearest, best = -1, -1, at_most
    for k in range(-1, robot.shape[0] * other):
        p = first if k < 0 else k
        if p < 0 or k == first:
            continue
        g, j, reach = p // other, p % other, max(best, 0.0)
        if bounds[g, j] > reach:
            continue
        i, kind = robot[g], _BOX
        _pose_of(poses[index[i, BODY]], shapes[i], A)
        if j < segments:
            kind = _CAPSULE
            _capsule(ends[j], radii[j], B, size)
        else:
            _board(boards[j - segments], half_sizes, j - segments, B, size)
        distance = _measured(
            A, index[i], shapes[i], B, kind, size, vertices, starts, neighbours, planes, reach,
            view(work, 24, (12 + WORK,)), view(work, 24 + 12 + WORK, (7,)),
        )  # fmt: skip
        if distance < best:
            best, near, nearest = distance, i, j
            for m in range(7):
                found[m] = work[36 + WORK + m]
    return near, nearest
