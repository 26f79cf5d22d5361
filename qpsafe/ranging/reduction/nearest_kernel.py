"""The points nearest to the links of a robot's wire, spread apart; and whether an image is the last one again."""

from __future__ import annotations

from math import inf

from numba import types

from qpsafe.compiled.compiled import Array, Vector, add, dot, entry, inline, readable, row
from qpsafe.robot.kinematics import Index


@inline
def to_link(p: Vector, r0: Array, r1: Array, link: int) -> float:
    """Square of the distance of a point from a link of the wire."""
    d, w = add(row(r1, link), -1.0, row(r0, link)), add(p, -1.0, row(r0, link))
    n = add(w, -min(max(dot(w, d) / max(dot(d, d), 1e-300), 0.0), 1.0), d)
    return dot(n, n)


@inline
def keep_nearest(found: Array, n: int, away: Array, marks: Index, each: int, spread: float, kept: Array) -> int:
    """Fill `kept` with the `each` nearest of n points to each link, `spread` apart; returns how many those are.

    Args:
        found: Points in the first three columns, of which all are copied (n, columns).
        n: How many.
        away: Squares of their distances (links, n); changed.
        marks: To work in (n,), zeros.
        each: How many a link keeps.
        spread: [m].
        kept: At least links · each rows.
    """
    count, columns = 0, found.shape[1]
    for k in range(away.shape[0]):
        for _ in range(each):
            best, nearest = -1, inf
            for i in range(n):
                if away[k, i] < nearest:
                    best, nearest = i, away[k, i]
            if best < 0:
                break
            b = (found[best, 0], found[best, 1], found[best, 2])
            for i in range(n):  # what lies beside it is no other danger
                w = add((found[i, 0], found[i, 1], found[i, 2]), -1.0, b)
                if dot(w, w) <= spread * spread:
                    away[k, i] = inf
            if marks[best] == 0:  # not kept for another link
                marks[best] = 1
                for c in range(columns):
                    kept[count, c] = found[best, c]
                count += 1
    return count


_two = types.Array(types.float64, 2, "C", readonly=True)
_outs, _whole = types.float64[:, ::1], types.int64[::1]


@entry(types.int64(_two, _two, _two, _outs, _whole, types.int64, types.float64, _outs))
def reduce_points(
    points: Array, starts: Array, ends: Array, away: Array, marks: Index, each: int, spread: float, kept: Array
) -> int:
    """Keep the points nearest to each link of a wire; arguments as for `keep_nearest`. Returns how many those are."""
    for i in range(points.shape[0]):
        marks[i] = 0
        for k in range(starts.shape[0]):
            away[k, i] = to_link((points[i, 0], points[i, 1], points[i, 2]), starts, ends, k)
    return keep_nearest(points, points.shape[0], away, marks, each, spread, kept)


@entry(types.boolean(readable(1), readable(1)))
def same_numbers(a: Array, b: Array) -> bool:
    """Whether two arrays hold the same numbers; NaN is the same as NaN."""
    same = a.shape[0] == b.shape[0]
    for i in range(a.shape[0] if same else 0):
        same = same and (a[i] == b[i] or (a[i] != a[i] and b[i] != b[i]))
    return same
