"""What of the known things the rays of an image meet, compiled: those that may be in view are looked up once."""

from __future__ import annotations

from math import inf, sqrt

from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, inline, row, scale
from qpsafe.robot.kinematics import Index, place

#: Numbers of `reduce_zones`: the sensor's range, tolerance, how far points of a link are spread apart, how far away
#: from the wire points still matter [m], by how many standard deviations a reading may be wrong; the middle of the
#: sensor's view in its frame, cosine and sine of the cone around it that holds all directions.
NEAREST, FARTHEST, TOLERANCE, SPREAD, REACH, DEVIATIONS, MIDDLE, COSINE, SINE = 0, 1, 2, 3, 4, 5, 6, 9, 10
#: Columns of `around`: the middle of a known thing's ball as seen from the sensor, and the square of its distance.
SQUARE, AROUND = 3, 4


@inline
def turned(T: Array, v: Vector) -> Vector:
    """A direction of a frame's axes in the world."""
    return (
        T[0, 0] * v[0] + T[0, 1] * v[1] + T[0, 2] * v[2],
        T[1, 0] * v[0] + T[1, 1] * v[1] + T[1, 2] * v[2],
        T[2, 0] * v[0] + T[2, 1] * v[1] + T[2, 2] * v[2],
    )


@inline
def look_around(
    o: Vector, pose: Array, numbers: Array, carrier: int, poses: Array, bodies: Index, balls: Array, around: Array,
    among: Index,
) -> tuple[int, int]:  # fmt: skip
    """Fill `around`, and `among` with the numbers of known things but those of the body that carries the sensor.

    Returns:
        How many there are in all, `among[1]`; how many of these a ray within the sensor's view may meet, `among[0]`.
    """
    middle, every, some = turned(pose, (numbers[MIDDLE], numbers[MIDDLE + 1], numbers[MIDDLE + 2])), 0, 0
    for h in range(bodies.shape[0]):
        if bodies[h] == carrier:
            continue
        c = place(poses[bodies[h]], balls[h, 0], balls[h, 1], balls[h, 2])
        m = add(c, -1.0, o)
        square, r = dot(m, m), balls[h, 3]
        around[h, 0], around[h, 1], around[h, 2] = m
        around[h, SQUARE] = square
        among[1, every] = h
        every += 1
        away = sqrt(square)
        if away - r > numbers[FARTHEST] * (1.0 + 1e-9):
            continue
        if away > r:  # outside its ball: is the ball outside the cone of the view?
            s = r / away  # both cones together, by the angle-sum formulas
            t = sqrt(1.0 - s * s)
            sine, cosine = numbers[SINE] * t + numbers[COSINE] * s, numbers[COSINE] * t - numbers[SINE] * s
            if sine > 0.0 and dot(m, middle) < (cosine - 1e-9) * away:
                continue
        among[0, some] = h
        some += 1
    return every, some


@inline
def enters(
    a: Vector, farthest: float, around: Array, among: Index, poses: Array, bodies: Index, first: Index, planes: Array,
    balls: Array,
) -> float:  # fmt: skip
    """How far along a ray known things begin; inf if there are none as near as `farthest`.

    Those that the ray begins in are left out.

    Args:
        a: Direction.
        farthest: [m].
        around: As seen from where the ray begins, see `look_around`.
        among: Which are asked.
        poses: Of the robot's bodies.
        bodies, first, planes, balls: The known things.
    """
    nearest = inf
    for i in range(among.shape[0]):
        h = among[i]
        T, m = poses[bodies[h]], row(around, h)
        along, square, r2 = dot(m, a), around[h, SQUARE], balls[h, 3] * balls[h, 3]
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
            rise = n0 * u + n1 * v + n2 * w  # inside where height + t rise <= 0
            if rise < 0.0:
                begin = max(begin, -height / rise)
            elif rise > 0.0:
                end = min(end, -height / rise)
            elif height > 0.0:
                end = -1.0
            if end < begin:
                break
        if begin <= end and not inside:
            nearest = min(nearest, begin)
    return nearest


@inline
def blocked(
    a: Vector, slant: float, fat: float, farthest: float, around: Array, some: Index, every: Index, poses: Array,
    bodies: Index, first: Index, planes: Array, balls: Array,
) -> float:  # fmt: skip
    """How far a cone can be looked into at most before known things, which fill all of it; inf if they do not.

    What a zone reads is about the distance along its axis, and no more than half of the way to the far edge beyond.
    """
    middle = enters(a, farthest, around, some, poses, bodies, first, planes, balls)
    if middle == inf:
        return inf
    u = (0.0, a[2], -a[1]) if abs(a[0]) < 0.8 else (-a[2], 0.0, a[0])
    u = scale(1.0 / sqrt(dot(u, u)), u)
    v, wide, edge = cross(a, u), sqrt(0.5) * (slant + fat / max(middle, fat)), middle
    for i in range(4):
        b = add(add(a, wide if i < 2 else -wide, u), wide if i % 2 else -wide, v)
        b = scale(1.0 / sqrt(dot(b, b)), b)
        edge = max(edge, enters(b, farthest, around, every, poses, bodies, first, planes, balls))
    return 0.5 * (middle + edge) + fat
