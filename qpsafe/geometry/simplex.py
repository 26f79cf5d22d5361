"""The point of a simplex nearest to the origin, compiled.

The foot of the perpendicular where it lies within, else the nearest point of the simplex's boundary: simple, and it
does not go wrong where corners coincide or lie in one line or plane.
"""

from __future__ import annotations

from math import inf

from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, inline, row

Weights = tuple[float, float, float]


@inline
def on_segment(a: Vector, b: Vector) -> tuple[float, float]:
    """Squared distance of the origin, and the weight of b."""
    e = add(b, -1.0, a)
    ee = dot(e, e)
    t = min(max(-dot(a, e) / ee, 0.0), 1.0) if ee > 0.0 else 0.0
    # from the nearer corner, or a large one would hide what is left of a small one
    p = add(a, t, e) if t < 0.5 else add(b, t - 1.0, e)
    return dot(p, p), t


@inline
def on_triangle(a: Vector, b: Vector, c: Vector) -> tuple[float, Weights]:
    """Squared distance of the origin, and the weights of the corners."""
    e, f = add(b, -1.0, a), add(c, -1.0, a)
    ee = dot(e, e)
    if ee > 0.0:
        h = add(f, -dot(f, e) / ee, e)  # of f what is perpendicular to e
        hh = dot(h, h)
        if hh > 1e-28 * dot(f, f):
            y = -dot(a, h) / hh
            x = -dot(add(a, y, f), e) / ee
            if x >= 0.0 and y >= 0.0 and x + y <= 1.0:
                p = add(add(a, x, e), y, f)
                return dot(p, p), (1.0 - x - y, x, y)
    best, t = on_segment(a, b)
    weights = (1.0 - t, t, 0.0)
    other, t = on_segment(a, c)
    if other < best:
        best, weights = other, (1.0 - t, 0.0, t)
    other, t = on_segment(b, c)
    if other < best:
        best, weights = other, (0.0, 1.0 - t, t)
    return best, weights


@inline
def nearest_in_simplex(corners: Array, count: int, outside: bool, weights: Array) -> float:
    """Squared distance of the origin to the simplex of the first `count` corners (4, 3); 0 inside a tetrahedron.

    The corners' weights (4,) are filled: their weighted sum is the nearest point. Where the origin is known to be
    `outside`, which a flat tetrahedron tells wrong, the nearest point is looked for on its faces.
    """
    for i in range(4):
        weights[i] = 0.0
    if count == 1:
        weights[0] = 1.0
        p = row(corners, 0)
        return dot(p, p)
    if count == 2:
        best, t = on_segment(row(corners, 0), row(corners, 1))
        weights[0], weights[1] = 1.0 - t, t
        return best
    if count == 3:
        best, found = on_triangle(row(corners, 0), row(corners, 1), row(corners, 2))
        weights[0], weights[1], weights[2] = found
        return best
    best, inside = inf, True
    for skip in range(4):
        i, j, k = (1, 2, 3) if skip == 0 else (0, 2, 3) if skip == 1 else (0, 1, 3) if skip == 2 else (0, 1, 2)
        a, b, c, d = row(corners, i), row(corners, j), row(corners, k), row(corners, skip)
        n = cross(add(b, -1.0, a), add(c, -1.0, a))
        height, here = dot(n, add(d, -1.0, a)), -dot(n, a)
        if not outside and ((here > 0.0 and height > 0.0) or (here < 0.0 and height < 0.0)):
            continue  # the origin lies on the inner side of this face
        inside = False
        other, found = on_triangle(a, b, c)
        if other < best:
            best = other
            for m in range(4):
                weights[m] = 0.0
            weights[i], weights[j], weights[k] = found
    return 0.0 if inside else best
