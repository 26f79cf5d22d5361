"""Rows that keep shapes apart, compiled: which pairs could come too near before the joints can stand, and their rows.

Their bounds are `clearance_bound`'s.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

import numpy as np
from numba import types

from qpsafe import limits as limits_module
from qpsafe.compiled import by_reference as reference_module
from qpsafe.compiled.by_reference import by_reference
from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, entry, inline, row
from qpsafe.compiled.memory import view
from qpsafe.geometry import clearance_bound, clearance_work, nearness, pairs
from qpsafe.geometry import reach as reaches
from qpsafe.geometry.clearance_bound import bound_of
from qpsafe.geometry.clearance_work import MOST, cut_rows
from qpsafe.geometry.layout import BALL, BODY, FLOATS, INTEGERS, SPHERE, VERTEX
from qpsafe.geometry.nearness import apart, cut_tables, shape_pose
from qpsafe.geometry.pairs import measured
from qpsafe.geometry.reach import along_normal, look_ahead, passes, prepare, reach
from qpsafe.geometry.separation import WORK
from qpsafe.geometry.support import support
from qpsafe.robot.kinematics import Index, cut, place

TILT = 0.15  # how far the directions lean from the normal in which further points of a pair are looked for [rad]
AROUND = 8  # how many directions
SAME = 0.005  # of points nearer than that to the nearest one, none is a further one [m]
CLOSE = 0.05  # a pair that is nearer has rows of further points [m]
DEEP = 4  # pairs that overlap, whose depth takes long; where there are more, the rest has no rows in this tick
_POINT = np.array([SPHERE] + [0] * (INTEGERS - 1), dtype=np.int64)
_LEAN = np.array([(np.cos(i * np.pi / 4.0), np.sin(i * np.pi / 4.0)) for i in range(AROUND)]) * TILT
#: All the code that goes into the kernel.
USES = (limits_module, reference_module, clearance_bound, clearance_work, nearness, reaches, *pairs.USES, pairs)


@inline
def _place(r: Any, room: float) -> int:
    """Where a row may stand: a free place, or that of the row with the most room; -1 if that has less."""
    at = r.marks[0]
    if at < MOST:
        r.marks[0] = at + 1
    else:
        at = 0
        for i in range(1, MOST):
            if r.room[i] > r.room[at]:
                at = i
        if r.room[at] <= room:
            return -1
    r.room[at] = room
    return at


@inline
def _take(
    t: Any, r: Any, twists: Array, qd: Array, pair: int, a: int, b: int, p: Vector, o: Vector, n: Vector, d: float,
    dt: float,
) -> None:  # fmt: skip
    """The row of the points p of body a and o of body b, with the normal n from p to o, if it can be broken."""
    bound, left = bound_of(t, r, twists, qd, a, b, p, o, n, d - t.margins[pair], dt)
    if not left < 0.0:
        return
    at = _place(r, left)
    if at >= 0:
        r.high[at], r.gaps[at], r.which[at] = bound, d, pair
        for j in range(qd.shape[0]):
            r.A[at, j] = r.g[j]


@inline
def _normal(p: Vector, o: Vector, d: float, along: Array) -> Vector:
    """Unit vector from a nearest point to the other, the way out where shapes touch or overlap."""
    if abs(d) > 1e-9:
        n = add(o, -1.0, p)
        return n[0] / d, n[1] / d, n[2] / d
    return row(view(along, 0, (1, 3)), 0)


@inline
def _further(
    t: Any, r: Any, poses: Array, twists: Array, qd: Array, pair: int, i: int, j: int, p: Vector, n: Vector, d: float,
    dt: float,
) -> None:  # fmt: skip
    """Rows of other points of one shape of a pair, against all of the other shape: those that lean towards it.

    So that rows do not jump where the nearest point does, along edges and over corners.

    Args:
        t, r, poses, twists, qd, pair, dt: As for `clearance_rows`.
        i, j: The shape whose points they are, and the other one.
        p: Nearest point of shape i.
        n: Normal from it to the other shape.
        d: Distance.
    """
    a, b = t.index[i, BODY], t.index[j, BODY]
    T, size = poses[a], view(r.pair, 2 * (43 + WORK), (FLOATS,))
    A, B = view(r.pair, 43 + WORK, (12,)), view(r.pair, 43 + WORK + 12, (12,))
    rest, found = view(r.pair, 43 + WORK + 24, (12 + WORK,)), view(r.pair, 43 + WORK + 36 + WORK, (7,))
    # two directions across the normal
    x = (1.0, 0.0, 0.0) if abs(n[0]) < 0.6 else (0.0, 1.0, 0.0)
    u = cross(n, x)
    length = sqrt(dot(u, u))
    u = (u[0] / length, u[1] / length, u[2] / length)
    v = cross(n, u)
    for q in range(FLOATS):
        size[q] = 0.0
    last, before, at = -1, -1, t.index[i, VERTEX]
    start = at
    for k in range(AROUND):
        e = add(add(n, _LEAN[k, 0], u), _LEAN[k, 1], v)
        local = (
            T[0, 0] * e[0] + T[1, 0] * e[1] + T[2, 0] * e[2],
            T[0, 1] * e[0] + T[1, 1] * e[1] + T[2, 1] * e[2],
            T[0, 2] * e[0] + T[1, 2] * e[1] + T[2, 2] * e[2],
        )
        c, at = support(t.index[i], t.shapes[i], local, at, False, t.vertices, t.starts, t.neighbours)
        if at in (last, before) or (k > 0 and at == start):
            continue
        if k == 0:
            start = at
        before, last = last, at
        c = place(T, c[0], c[1], c[2])
        # the other shape lies beyond the plane through its nearest point: no farther than that, and seldom nearer
        e = add(p, -1.0, c)
        deeper = dot(n, e)
        if dot(e, e) < SAME * SAME:
            continue
        if not bound_of(t, r, twists, qd, a, b, c, c, n, d + deeper - t.margins[pair], dt)[1] < 0.0:
            continue
        for q in range(12):
            A[q] = 1.0 if q == 0 or q == 5 or q == 10 else 0.0
        A[3], A[7], A[11] = c
        shape_pose(poses[b], t.shapes[j], B)
        measured(
            A, _POINT, size, B, t.index[j], t.shapes[j], t.vertices, t.starts, t.neighbours, t.planes, inf, rest, found
        )
        o = (found[4], found[5], found[6])
        m = _normal(c, o, found[0], view(rest, 12 + 6, (3,)))
        _take(t, r, twists, qd, pair, a, b, c, o, m, found[0], dt)


@inline
def _pair_rows(t: Any, r: Any, poses: Array, twists: Array, qd: Array, pair: int, within: float, dt: float) -> None:
    """Rows of one pair of shapes that may be nearer than `within`."""
    i, j = t.pairs[pair, 0], t.pairs[pair, 1]
    A, B = view(r.pair, 0, (12,)), view(r.pair, 12, (12,))
    rest, found = view(r.pair, 24, (12 + WORK,)), view(r.pair, 36 + WORK, (7,))
    shape_pose(poses[t.index[i, BODY]], t.shapes[i], A)
    shape_pose(poses[t.index[j, BODY]], t.shapes[j], B)
    found[0] = inf
    measured(
        A, t.index[i], t.shapes[i], B, t.index[j], t.shapes[j], t.vertices, t.starts, t.neighbours, t.planes, within,
        rest, found,
    )  # fmt: skip
    if not found[0] < inf:
        return
    if found[0] < 0.0:
        r.marks[1] += 1
    d, p, o = found[0], (found[1], found[2], found[3]), (found[4], found[5], found[6])
    along = view(rest, 12 + 6, (3,))
    if abs(d) <= 1e-9:  # the way out, in the first shape's frame
        x, y, z = along[0], along[1], along[2]
        for q in range(3):
            along[q] = A[4 * q] * x + A[4 * q + 1] * y + A[4 * q + 2] * z
    n = _normal(p, o, d, along)
    a, b = t.index[i, BODY], t.index[j, BODY]
    size = max(t.shapes[i, BALL + 3], t.shapes[j, BALL + 3])
    if d - t.margins[pair] > along_normal(t, r, twists, qd, a, b, row(r.globes, i), row(r.globes, j), size, n):
        return
    _take(t, r, twists, qd, pair, a, b, p, o, n, d, dt)
    if not 0.0 < d < CLOSE:
        return
    _further(t, r, poses, twists, qd, pair, i, j, p, n, d, dt)
    _further(t, r, poses, twists, qd, pair, j, i, o, (-n[0], -n[1], -n[2]), d, dt)


_one, _whole = types.Array(types.float64, 1, "C", readonly=True), types.Array(types.int64, 1, "C", readonly=True)
_read = types.Array(types.float64, 1, "A", readonly=True)


@entry(
    types.int64(
        _one, _read, types.Array(types.float64, 2, "C", readonly=True), types.float64, _one, _whole,
        types.float64[::1], types.int64[::1],
    ),
    *USES,
)  # fmt: skip
def clearance_rows(
    memory: Array, qd: Array, limits: Array, dt: float, floats: Array, integers: Index, work: Array, whole: Index
) -> int:
    """Fill `Rows` from two blocks; returns how many there are: 0 where nothing can come too near.

    Args:
        memory: Kinematics of the commanded position, see `qpsafe.robot.kinematics.cut`.
        qd: Commanded velocity (n,) [rad/s].
        limits: Lower, upper, velocity, acceleration (4, n), see `JointLimits.table`.
        dt: Tick [s].
        floats, integers: The solids, see `nearness.Tables`.
        work, whole: As `sizes_of` says.
    """
    t = by_reference(cut_tables(floats, integers))
    n = qd.shape[0]
    r = by_reference(cut_rows(work, whole, n, t.index.shape[0]))
    poses, twists = cut(memory, n, integers[1])[:2]
    r.marks[0] = r.marks[1] = 0
    prepare(t, r, poses, twists, qd, limits, dt)
    margin, ahead = t.numbers[0], False
    for group in range(t.groups.shape[0]):
        a, b, first, count, shape = (
            t.groups[group, 0], t.groups[group, 1], t.groups[group, 2], t.groups[group, 3], t.groups[group, 4],
        )  # fmt: skip
        within = margin + reach(t, r, a, b)
        c = row(r.balls, a)
        if shape >= 0:  # a single shape of the other body
            if apart(t, poses, shape, c, t.balls[a, 3] + within, row(r.globes, shape)):
                continue
            if passes(t, r, twists, qd, a, shape, c, t.balls[a, 3], margin):
                continue
        else:
            e = add(c, -1.0, row(r.balls, b))
            most = t.balls[a, 3] + t.balls[b, 3] + within
            if dot(e, e) > most * most:
                continue
        for pair in range(first, first + count):
            i, j = t.pairs[pair, 0], t.pairs[pair, 1]
            c, o = row(r.globes, i), row(r.globes, j)
            if apart(t, poses, j, c, t.shapes[i, BALL + 3] + within, o):
                continue
            if shape < 0:
                if apart(t, poses, i, o, t.shapes[j, BALL + 3] + within, c):
                    continue
            elif passes(t, r, twists, qd, a, shape, c, t.shapes[i, BALL + 3], margin):
                continue
            if not ahead:  # seldom needed
                look_ahead(r, qd, limits, dt)
                ahead = True
            _pair_rows(t, r, poses, twists, qd, pair, within, dt)
            if r.marks[1] == DEEP:
                return r.marks[0]
    return r.marks[0]
