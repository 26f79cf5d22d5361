"""The signed distance of two convex shapes, compiled: Gilbert, Johnson and Keerthi's algorithm.

The distance of two cores is that of the origin to the set of differences a - b of their points. A simplex in that set
is moved towards the origin by support points. With v the simplex's nearest point and w the support point against v,
v·w / |v| <= distance <= |v|: the algorithm ends when both are the same, or when the lower one says enough.

Margins are taken off afterwards, so that shapes that overlap by less than these have their true depth. Where cores
overlap, the depth added to the margins is the shortest of some shifts that part them: along the normals of their faces,
their axes and the line of their centres. It is no less than the true depth, and the same where a face is nearest.
"""

from __future__ import annotations

from math import inf, sqrt

from numba import types

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import Array, Vector, add, dot, entry, inline, row
from qpsafe.compiled.memory import view
from qpsafe.geometry import layout, simplex
from qpsafe.geometry import support as supports
from qpsafe.geometry.layout import CASE, KIND, MARGIN, MESH, PLANE, PLANES, PLANES_FROM, VERTEX
from qpsafe.geometry.simplex import nearest_in_simplex
from qpsafe.geometry.support import support
from qpsafe.robot.kinematics import Index

CLOSE = 1e-12  # difference of upper and lower bound that ends the search, beside 1e-13 of the distance [m]
STEPS = 128  # enough for round shapes, polytopes need about ten; what is reached then is still an upper bound
WORK = 64  # numbers that `separation` works in

USES = (layout, simplex, supports, compiled)

_ints, _one, _two = (types.Array(kind, n, "C", readonly=True) for kind, n in
                     ((types.int64, 1), (types.float64, 1), (types.float64, 2)))  # fmt: skip
shape_types = (_ints, _one, _ints, _one, _one)
hull_types = (_two, _ints, _ints, _two)


@inline
def _into(T: Array, d: Vector) -> Vector:
    """A direction in the axes of a frame at T (12,)."""
    return (
        T[0] * d[0] + T[4] * d[1] + T[8] * d[2],
        T[1] * d[0] + T[5] * d[1] + T[9] * d[2],
        T[2] * d[0] + T[6] * d[1] + T[10] * d[2],
    )


@inline
def _out_of(T: Array, p: Vector) -> Vector:
    """A point of a frame at T (12,)."""
    return (
        T[0] * p[0] + T[1] * p[1] + T[2] * p[2] + T[3],
        T[4] * p[0] + T[5] * p[1] + T[6] * p[2] + T[7],
        T[8] * p[0] + T[9] * p[1] + T[10] * p[2] + T[11],
    )


@inline
def _extremes(
    kind: Index, shape: Array, other: Index, others: Array, T: Array, n: Vector, at: int, there: int, careful: bool,
    vertices: Array, starts: Index, neighbours: Index,
) -> tuple[Vector, Vector, int, int]:  # fmt: skip
    """The points of the first core farthest along n and of the second one farthest against it; and their vertices."""
    a, at = support(kind, shape, n, at, careful, vertices, starts, neighbours)
    m = _into(T, (-n[0], -n[1], -n[2]))
    b, there = support(other, others, m, there, careful, vertices, starts, neighbours)
    return a, _out_of(T, b), at, there


@inline
def _depth(
    kind: Index, shape: Array, other: Index, others: Array, T: Array,
    vertices: Array, starts: Index, neighbours: Index, planes: Array, work: Array,
) -> float:  # fmt: skip
    """The shortest of some shifts that part two cores; the first one's farthest point and the direction in work.

    The second core must move along the unit vector n by h = max n·a - min n·b to be parted from the first one.
    """
    best, at, there = inf, kind[VERTEX], other[VERTEX]
    c = add(_out_of(T, row(view(others, CASE, (1, 3)), 0)), -1.0, row(view(shape, CASE, (1, 3)), 0))
    length = sqrt(dot(c, c))
    mine = kind[PLANES] if kind[KIND] == MESH else 0
    his = other[PLANES] if other[KIND] == MESH else 0
    for i in range(14 + mine + his):
        if i < 2:  # the line of centres
            n = (0.0, 0.0, 1.0) if length == 0.0 else (c[0] / length, c[1] / length, c[2] / length)
        elif i < 8:  # the axes of both
            n = (1.0 if i < 4 else 0.0, 1.0 if 4 <= i < 6 else 0.0, 1.0 if i >= 6 else 0.0)
        elif i < 14:
            k = (i - 8) // 2
            n = (T[k], T[4 + k], T[8 + k])
            if dot(n, n) < 0.5:  # the frame of a person's capsule has one axis only
                continue
        elif i < 14 + mine:  # the normals of both
            n = row(planes, kind[PLANES_FROM] + i - 14)
        else:
            n = add(_out_of(T, row(planes, other[PLANES_FROM] + i - 14 - mine)), -1.0, (T[3], T[7], T[11]))
        if (i < 14 and i % 2 == 1) or i >= 14 + mine:
            n = (-n[0], -n[1], -n[2])
        a, b, at, there = _extremes(kind, shape, other, others, T, n, at, there, False, vertices, starts, neighbours)
        shift = dot(n, add(a, -1.0, b))
        if shift < best:
            best = shift
            work[0], work[1], work[2] = a
            work[6], work[7], work[8] = n
    return max(best, 0.0)


@inline
def _core_distance(
    kind: Index, shape: Array, other: Index, others: Array, T: Array,
    vertices: Array, starts: Index, neighbours: Index, limit: float, work: Array,
) -> float:  # fmt: skip
    """Distance of two cores, 0 if they overlap, +inf if it is larger than `limit`.

    The nearest points are in work[:6], in the first shape's frame.
    """
    corners, on_a, on_b, weights = (
        view(work, 9, (4, 3)),
        view(work, 21, (4, 3)),
        view(work, 33, (4, 3)),
        view(work, 45, (4,)),
    )
    # any direction will do to begin with; that of the line of centres is good
    v = add(row(view(shape, CASE, (1, 3)), 0), -1.0, _out_of(T, row(view(others, CASE, (1, 3)), 0)))
    if not dot(v, v) > 0.0:
        v = (1.0, 0.0, 0.0)
    count, vv, size2, careful, apart, at, there = 0, inf, 0.0, False, False, kind[VERTEX], other[VERTEX]
    for _ in range(STEPS):
        n = (-v[0], -v[1], -v[2])
        a, b, at, there = _extremes(kind, shape, other, others, T, n, at, there, careful, vertices, starts, neighbours)
        w = add(a, -1.0, b)
        size2 = max(size2, dot(w, w))
        done = False
        length, reached = sqrt(dot(v, v)), dot(v, w)
        if reached > limit * length:
            return inf
        apart = apart or reached > CLOSE * length
        if count > 0:
            done = vv - reached <= length * (CLOSE + 1e-13 * length)
            for i in range(count):
                done = done or (w[0] == corners[i, 0] and w[1] == corners[i, 1] and w[2] == corners[i, 2])
        if not done:
            for k in range(3):
                corners[count, k], on_a[count, k], on_b[count, k] = w[k], a[k], b[k]
            nearer = nearest_in_simplex(corners, count + 1, apart, weights)
            if nearer < vv:
                vv, size, count = nearer, count + 1, 0
                v, p, q = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
                if size == 4 and vv == 0.0:
                    return 0.0
                for i in range(size):
                    s = weights[i]
                    if s > 0.0:
                        v = add(v, s, row(corners, i))
                        p, q = add(p, s, row(on_a, i)), add(q, s, row(on_b, i))
                        for k in range(3):
                            corners[count, k], on_a[count, k], on_b[count, k] = corners[i, k], on_a[i, k], on_b[i, k]
                        count += 1
                work[0], work[1], work[2] = p
                work[3], work[4], work[5] = q
                if vv <= 1e-28 * size2 and not apart:  # the origin, but for rounding
                    return 0.0
                continue
        if careful:
            break
        careful = True  # look at all vertices once more
    return sqrt(vv)


@entry(types.float64(*shape_types, *hull_types, types.float64, types.float64[::1]), *USES)
def separation(
    kind: Index,
    shape: Array,
    other: Index,
    others: Array,
    T: Array,
    vertices: Array,
    starts: Index,
    neighbours: Index,
    planes: Array,
    limit: float,
    work: Array,
) -> float:
    """The signed distance of two shapes, +inf if it is larger than `limit` (or NaN).

    Args:
        kind, shape: Rows of `World.index` and `World.shapes` of the first shape; its pose does not matter.
        other, others: Of the second one. Only this one may be a plane.
        T: Pose of the second in the first one's frame, rows of (3, 4), (12,).
        vertices, starts, neighbours, planes: Of the world, see `World.solid`.
        limit: Larger distances are not computed; not below 0.
        work: `WORK` numbers; the nearest points on the surfaces, first shape's frame, are left in work[:6].
    """
    margins = shape[MARGIN] + others[MARGIN]
    if other[KIND] == PLANE:
        n = (T[2], T[6], T[10])
        a, _ = support(kind, shape, (-n[0], -n[1], -n[2]), kind[VERTEX], True, vertices, starts, neighbours)
        a = add(a, -shape[MARGIN], n)
        height = dot(n, a) - (n[0] * T[3] + n[1] * T[7] + n[2] * T[11])
        work[0], work[1], work[2] = a
        work[3], work[4], work[5] = add(a, -height, n)
        return height if height <= limit else inf
    gap = _core_distance(kind, shape, other, others, T, vertices, starts, neighbours, limit + margins, work)
    if gap == inf:
        return inf
    a, b = (work[0], work[1], work[2]), (work[3], work[4], work[5])
    n = add(b, -1.0, a)
    length = sqrt(dot(n, n))
    if gap > 0.0 and length > 0.0:
        n = (n[0] / length, n[1] / length, n[2] / length)
    else:
        gap = -_depth(kind, shape, other, others, T, vertices, starts, neighbours, planes, work)
        a, n = (work[0], work[1], work[2]), (work[6], work[7], work[8])
        b = add(a, gap, n)
    work[0], work[1], work[2] = add(a, shape[MARGIN], n)
    work[3], work[4], work[5] = add(b, -others[MARGIN], n)
    return gap - margins
