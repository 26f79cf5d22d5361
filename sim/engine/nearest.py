"""The smallest distance of the robot to people, compiled; as `qpsafe.geometry.pairs` does it for pairs of shapes."""

from __future__ import annotations

from math import inf, isfinite, nan, sqrt

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, add, dot, entry, inline, row
from qpsafe.compiled.memory import view
from qpsafe.geometry import pairs
from qpsafe.geometry.layout import BALL, BODY, BOX, CAPSULE, CASE, FLOATS, INTEGERS, MARGIN, SIZE
from qpsafe.geometry.pairs import PAIR, ball_of, beyond, measured, pose_of
from qpsafe.geometry.separation import WORK, hull_types
from qpsafe.robot.kinematics import Index

_CAPSULE = np.array([CAPSULE] + [0] * (INTEGERS - 1), dtype=np.int64)  # what people are made of
_BOX = np.array([BOX] + [0] * (INTEGERS - 1), dtype=np.int64)

USES = (*pairs.USES, pairs)

_ints, _pairs = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 2, "C", readonly=True)
_one, _two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))


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
        c, r = ball_of(poses[index[i, BODY]], shapes[i]), shapes[i, BALL + 3]
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
            bound = beyond(B, size, c, r)
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
        pose_of(poses[index[i, BODY]], shapes[i], A)
        if j < segments:
            kind = _CAPSULE
            _capsule(ends[j], radii[j], B, size)
        else:
            _board(boards[j - segments], half_sizes, j - segments, B, size)
        distance = measured(
            A, index[i], shapes[i], B, kind, size, vertices, starts, neighbours, planes, reach,
            view(work, 24, (12 + WORK,)), view(work, 24 + 12 + WORK, (7,)),
        )  # fmt: skip
        if distance < best:
            best, near, nearest = distance, i, j
            for m in range(7):
                found[m] = work[36 + WORK + m]
    return near, nearest
