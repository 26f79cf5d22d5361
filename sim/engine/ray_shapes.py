"""Where a ray meets the surface of a shape first, compiled; +inf where it does not.

A ray o + t d with |d| = 1 and t >= 0, in the shape's frame. From inside, the surface is met from inside. Only a plane
has one side: it is met from above, within its sizes where it has some.
"""

from __future__ import annotations

from math import copysign, inf, sqrt

from qpsafe.compiled.compiled import Vector, add, dot, inline
from qpsafe.geometry.layout import CAPSULE, CYLINDER, ELLIPSOID, PLANE, SPHERE

TINY = 1e-15  # of what is no direction


@inline
def _first(near: float, far: float) -> float:
    """The first of two crossings that lies ahead."""
    return near if near >= 0.0 else far if far >= 0.0 else inf


@inline
def ray_plane(o: Vector, d: Vector, a: float, b: float) -> float:
    """The plane z = 0 from above, within |x| <= a and |y| <= b where these are > 0."""
    if d[2] > -TINY or o[2] < 0.0:
        return inf
    t = -o[2] / d[2]
    x, y = o[0] + t * d[0], o[1] + t * d[1]
    return t if (a <= 0.0 or abs(x) <= a) and (b <= 0.0 or abs(y) <= b) else inf


@inline
def ray_ellipsoid(o: Vector, d: Vector, a: float, b: float, c: float) -> float:
    """The ellipsoid of semi-axes a, b, c around the origin."""
    o, d = (o[0] / a, o[1] / b, o[2] / c), (d[0] / a, d[1] / b, d[2] / c)
    A, B, C = dot(d, d), dot(o, d), dot(o, o) - 1.0
    h = B * B - A * C
    if h < 0.0:
        return inf
    h = sqrt(h)
    return _first((-B - h) / A, (-B + h) / A)


@inline
def ray_capsule(o: Vector, d: Vector, start: Vector, axis: Vector, r: float) -> float:
    """The capsule of radius r around the segment from `start` to `start + axis`."""
    o = add(o, -1.0, start)
    length = sqrt(dot(axis, axis))
    s = 1.0 / length if length > 0.0 else 0.0
    u = (s * axis[0], s * axis[1], s * axis[2])
    # the infinite cylinder |p⊥ + t d⊥| = r around the axis
    z, w = dot(o, u), dot(d, u)
    p, q = add(o, -z, u), add(d, -w, u)
    A, B, C = dot(q, q), dot(p, q), dot(p, p) - r * r
    best = inf
    h = B * B - A * C
    if h < 0.0:
        return inf  # then both balls are missed too
    if A > TINY * TINY:
        h = sqrt(h)
        for t in ((-B - h) / A, (-B + h) / A):
            if 0.0 <= t < best and 0.0 <= z + t * w <= length:
                best = t
    for k in range(2):
        # the outer half of the ball around an end
        m = o if k == 0 else add(o, -1.0, axis)
        B, C = dot(m, d), dot(m, m) - r * r
        h = B * B - C
        if h >= 0.0:
            h = sqrt(h)
            for t in (-B - h, -B + h):
                side = z + t * w
                if 0.0 <= t < best and (side <= 0.0 if k == 0 else side >= length):
                    best = t
    return best


@inline
def ray_cylinder(o: Vector, d: Vector, r: float, half: float) -> float:
    """The cylinder of radius r and height 2 half around the z axis."""
    near, far = -inf, inf
    A, B, C = d[0] * d[0] + d[1] * d[1], o[0] * d[0] + o[1] * d[1], o[0] * o[0] + o[1] * o[1] - r * r
    if A > TINY * TINY:
        h = B * B - A * C
        if h < 0.0:
            return inf
        h = sqrt(h)
        near, far = (-B - h) / A, (-B + h) / A
    elif C > 0.0:
        return inf
    if abs(d[2]) > TINY:
        low, high = (-half - o[2]) / d[2], (half - o[2]) / d[2]
        near, far = max(near, min(low, high)), min(far, max(low, high))
    elif abs(o[2]) > half:
        return inf
    return _first(near, far) if near <= far else inf


@inline
def inverse(d: Vector) -> Vector:
    """1 / d, large where d has no component."""
    x, y, z = max(abs(d[0]), 1e-30), max(abs(d[1]), 1e-30), max(abs(d[2]), 1e-30)
    return copysign(1.0 / x, d[0]), copysign(1.0 / y, d[1]), copysign(1.0 / z, d[2])


@inline
def box_span(o: Vector, inv: Vector, a: float, b: float, c: float) -> tuple[float, float]:
    """Where a line enters and leaves the box of half sizes a, b, c around the origin; the first is larger if never."""
    near, far = -inf, inf
    for x, s, half in ((o[0], inv[0], a), (o[1], inv[1], b), (o[2], inv[2], c)):
        one, other = (-half - x) * s, (half - x) * s
        near, far = max(near, min(one, other)), min(far, max(one, other))
    return near, far


@inline
def ray_box(o: Vector, d: Vector, a: float, b: float, c: float) -> float:
    """The box of half sizes a, b, c around the origin."""
    near, far = box_span(o, inverse(d), a, b, c)
    return _first(near, far) if near <= far else inf


@inline
def ray_primitive(kind: int, o: Vector, d: Vector, a: float, b: float, c: float) -> float:
    """A shape of the given kind, but no mesh, with MuJoCo's three sizes."""
    if kind == PLANE:
        return ray_plane(o, d, a, b)
    if kind == SPHERE:
        return ray_ellipsoid(o, d, a, a, a)
    if kind == CAPSULE:
        return ray_capsule(o, d, (0.0, 0.0, -b), (0.0, 0.0, 2.0 * b), a)
    if kind == ELLIPSOID:
        return ray_ellipsoid(o, d, a, b, c)
    if kind == CYLINDER:
        return ray_cylinder(o, d, a, b)
    return ray_box(o, d, a, b, c)
