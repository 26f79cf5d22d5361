"""From one image to the few points of it that matter, compiled.

    zones --pose at the stamp--> points --self and known rules--> points that count --nearest to each link--> candidates

A dense image says no more than a sparse one of the same surface, so few of its points are kept: for each link of the
wire those that are nearest to it, spread apart, since what lies beside a nearer point is no other danger.
"""

from __future__ import annotations

from math import inf

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, Vector, add, dot, entry, inline, readable, row
from qpsafe.robot.kinematics import Index, place
from qpsafe.sensing import hulls
from qpsafe.sensing.hulls import within

#: What an image shows, see `Told` in `qpsafe.ranging.reduce`.
VALID, HITS, OWN, KNOWN, EXPECTED, THROUGH, IMPOSSIBLE, SEEN = range(8)
SHOWN = 8
#: Numbers of a call: the sensor's range, tolerance, how far points of a link are spread apart, how far away from the
#: wire points still matter [m], by how many standard deviations a reading may be wrong.
NEAREST, FARTHEST, TOLERANCE, SPREAD, REACH, DEVIATIONS = range(6)


@inline
def to_link(p: Vector, r0: Array, r1: Array, link: int) -> float:
    """Square of the distance of a point from a link of the wire."""
    d, w = add(row(r1, link), -1.0, row(r0, link)), add(p, -1.0, row(r0, link))
    n = add(w, -min(max(dot(w, d) / max(dot(d, d), 1e-300), 0.0), 1.0), d)
    return dot(n, n)


@inline
def turned(T: Array, v: Vector) -> Vector:
    """A direction of a frame's axes in the world."""
    return (
        T[0, 0] * v[0] + T[0, 1] * v[1] + T[0, 2] * v[2],
        T[1, 0] * v[0] + T[1, 1] * v[1] + T[1, 2] * v[2],
        T[2, 0] * v[0] + T[2, 1] * v[1] + T[2, 2] * v[2],
    )


@inline
def enters(
    o: Vector, a: Vector, slant: float, shrunk: float, farthest: float, poses: Array, bodies: Index, first: Index,
    planes: Array, balls: Array,
) -> float:  # fmt: skip
    """How far along a ray known things are met by all of its cone; inf if nowhere.

    Things are taken smaller by `shrunk` and by the cone's radius there. A ray that begins in one is none of its.
    """
    nearest = inf
    for h in range(bodies.shape[0]):
        T = poses[bodies[h]]
        c = place(T, balls[h, 0], balls[h, 1], balls[h, 2])
        m = add(c, -1.0, o)
        along, square, r2 = dot(m, a), dot(m, m), balls[h, 3] * balls[h, 3]
        if square > r2 and (
            along <= 0.0 or along - balls[h, 3] > min(farthest, nearest) or square - along * along > r2
        ):
            continue
        # into the body's axes
        x = T[0, 0] * -m[0] + T[1, 0] * -m[1] + T[2, 0] * -m[2] + balls[h, 0]
        y = T[0, 1] * -m[0] + T[1, 1] * -m[1] + T[2, 1] * -m[2] + balls[h, 1]
        z = T[0, 2] * -m[0] + T[1, 2] * -m[1] + T[2, 2] * -m[2] + balls[h, 2]
        u = T[0, 0] * a[0] + T[1, 0] * a[1] + T[2, 0] * a[2]
        v = T[0, 1] * a[0] + T[1, 1] * a[1] + T[2, 1] * a[2]
        w = T[0, 2] * a[0] + T[1, 2] * a[1] + T[2, 2] * a[2]
        begin, end, inside = 0.0, farthest, True
        for k in range(first[h], first[h + 1]):
            n0, n1, n2 = planes[k, 0], planes[k, 1], planes[k, 2]
            height = n0 * x + n1 * y + n2 * z + planes[k, 3]
            inside = inside and height <= 0.0
            # height + t rise <= -(shrunk + slant t)
            rise, height = n0 * u + n1 * v + n2 * w + slant, height + shrunk
            if rise < 0.0:
                begin = max(begin, -height / rise)
            elif rise > 0.0:
                end = min(end, -height / rise)
            elif height > 0.0:
                end = -1.0
        if begin <= end and not inside:
            nearest = min(nearest, begin)
    return nearest


_ints = types.Array(types.int64, 1, "C", readonly=True)
_two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (2, 3))
_out, _outs, _whole = types.float64[::1], types.float64[:, ::1], types.int64[::1]


@entry(
    types.int64(
        readable(1), readable(1), types.Array(types.boolean, 1, "A", readonly=True), _two, readable(1), _two,
        readable(1), _two, _two, _three, _ints, _ints, _two, _two, _outs, _outs, _whole, types.int64, types.int64,
        _outs, _whole,
    ),
    hulls,
)  # fmt: skip
def reduce_zones(
    distances: Array,
    sigma: Array,
    valid: Array,
    directions: Array,
    slants: Array,
    pose: Array,
    numbers: Array,
    starts: Array,
    ends: Array,
    poses: Array,
    bodies: Index,
    first: Index,
    planes: Array,
    balls: Array,
    found: Array,
    away: Array,
    zones: Index,
    each: int,
    stride: int,
    kept: Array,
    shown: Index,
) -> int:
    """Keep the points of an image that matter, (c, 4): place in the world [m], how wrong it may be [m].

    Args:
        distances, sigma, valid: Of z zones [m].
        directions, slants: Of the zones in the sensor's frame (z, 3), tangents of half their cones (z,).
        pose: Of the sensor when the image was taken (4, 4).
        numbers: As named above.
        starts, ends: Of the robot's wire now (links, 3).
        poses: Of the robot's bodies when the image was taken (b, 4, 4).
        bodies, first, planes, balls: The robot itself and known obstacles, see `HullSet.tables`.
        found, away, zones: To work in: (z, 4), (links, z), (z,).
        each: How many points a link keeps.
        stride: Of so many zones one is asked whether it sees through what is known.
        kept: Filled, at least links · each rows.
        shown: Filled with counts of zones (`SHOWN`,).

    Returns:
        c, how many points are kept.
    """  # fmt: skip
    o = (pose[0, 3], pose[1, 3], pose[2, 3])
    links, reach = starts.shape[0], numbers[REACH] * numbers[REACH]
    shown[:] = 0
    n = 0
    for i in range(distances.shape[0]):
        d = distances[i]
        if not valid[i] or d != d:
            continue
        if not d >= 0.0:
            shown[IMPOSSIBLE] += 1
            continue
        shown[VALID] += 1
        a = turned(pose, row(directions, i))
        wrong = numbers[DEVIATIONS] * sigma[i]
        fat = numbers[TOLERANCE] + wrong
        if i % stride == 0:
            surface = enters(o, a, slants[i], fat, min(numbers[FARTHEST], 1e3), poses, bodies, first, planes, balls)
            if surface < inf:
                shown[EXPECTED] += 1
                if d > surface + fat:
                    shown[THROUGH] += 1
        if d > numbers[FARTHEST]:
            continue
        shown[HITS] += 1
        p = add(o, d, a)
        if d >= numbers[NEAREST]:
            hull = within(p, fat + slants[i] * d, poses, bodies, first, planes, balls)
            if hull >= 0:
                shown[KNOWN if bodies[hull] == 0 else OWN] += 1
                continue
        least = inf
        for k in range(links):
            away[k, n] = to_link(p, starts, ends, k)
            least = min(least, away[k, n])
        if least > reach:
            continue
        found[n, 0], found[n, 1], found[n, 2] = p
        found[n, 3] = wrong + slants[i] * d
        zones[n] = 0
        n += 1
    shown[SEEN] = n
    spread, count = numbers[SPREAD] * numbers[SPREAD], 0
    for k in range(links):
        for _ in range(each):
            best, nearest = -1, inf
            for i in range(n):
                if away[k, i] < nearest:
                    best, nearest = i, away[k, i]
            if best < 0:
                break
            b = row(found, best)
            for i in range(n):  # what lies beside it is no other danger
                w = add(row(found, i), -1.0, b)
                if dot(w, w) <= spread:
                    away[k, i] = inf
            if zones[best] == 0:  # not kept for another link
                zones[best] = 1
                for c in range(4):
                    kept[count, c] = found[best, c]
                count += 1
    return count


@entry(
    types.void(
        readable(2), types.Array(types.boolean, 2, "A", readonly=True), types.int64, types.int64, _out,
        types.boolean[::1],
    )
)  # fmt: skip
def tile(distances: Array, valid: Array, size: int, support: int, nearest: Array, known: Array) -> None:
    """The nearest surface in each tile of a dense image: what `support` pixels see as near as that.

    Fewer pixels are noise, or edges that mix what is before them with what is behind.

    Args:
        distances: Of the pixels (rows, columns) [m].
        valid: Likewise.
        size: Pixels along the edge of a tile; those at the right and lower end may be smaller.
        support: How many, from 1 to 4.
        nearest: Filled, one a tile, row by row [m]; inf where nothing is in sight.
        known: Filled: whether at least `support` pixels of the tile are valid.
    """
    rows, columns = distances.shape
    wide = (columns + size - 1) // size
    for i in range(nearest.shape[0]):
        top, left = size * (i // wide), size * (i % wide)
        a, b, c, e, count = inf, inf, inf, inf, 0
        for y in range(top, min(top + size, rows)):
            for x in range(left, min(left + size, columns)):
                d = distances[y, x]
                if valid[y, x] and d == d:
                    count += 1
                    if d < e:  # sorted into the four smallest
                        e = d
                        if e < c:
                            c, e = e, c
                        if c < b:
                            b, c = c, b
                        if b < a:
                            a, b = b, a
        nearest[i] = a if support == 1 else b if support == 2 else c if support == 3 else e
        known[i] = count >= support


def farthest_zone(size: int) -> int:
    """So that at most about a thousand zones of an image are asked whether they see through what is known."""
    return max(1, int(np.ceil(size / 1000)))
