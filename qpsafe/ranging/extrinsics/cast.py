"""What a camera at a pose would see of the robot: rays against the hulls of its bodies, compiled."""

from __future__ import annotations

from math import inf

from numba import types

from qpsafe.compiled.compiled import Array, entry, readable
from qpsafe.robot.kinematics import Index

_ints = types.Array(types.int64, 1, "C", readonly=True)
_two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (2, 3))


_rows, _out, _outs = readable(2), types.float64[::1], types.float64[:, ::1]


@entry(types.void(_rows, _rows, _three, _ints, _ints, _two, _two, _out, _outs))
def cast(
    camera: Array, directions: Array, poses: Array, bodies: Index, first: Index, planes: Array, balls: Array,
    distances: Array, normals: Array,
) -> None:  # fmt: skip
    """Fill distances (k,), inf where the robot is not met, and normals there (k, 3), in the robot's base frame.

    Args:
        camera: Pose (4, 4).
        directions: Of the rays in the camera's frame (k, 3), unit.
        poses: Of the robot's bodies (b, 4, 4).
        bodies, first, planes, balls: As in `HullSet.tables`.
        distances, normals: The result.
    """
    o0, o1, o2 = camera[0, 3], camera[1, 3], camera[2, 3]
    for i in range(directions.shape[0]):
        a, b, c = directions[i, 0], directions[i, 1], directions[i, 2]
        u0 = camera[0, 0] * a + camera[0, 1] * b + camera[0, 2] * c
        u1 = camera[1, 0] * a + camera[1, 1] * b + camera[1, 2] * c
        u2 = camera[2, 0] * a + camera[2, 1] * b + camera[2, 2] * c
        nearest = inf
        for h in range(bodies.shape[0]):
            T = poses[bodies[h]]
            m0 = o0 - (T[0, 0] * balls[h, 0] + T[0, 1] * balls[h, 1] + T[0, 2] * balls[h, 2] + T[0, 3])
            m1 = o1 - (T[1, 0] * balls[h, 0] + T[1, 1] * balls[h, 1] + T[1, 2] * balls[h, 2] + T[1, 3])
            m2 = o2 - (T[2, 0] * balls[h, 0] + T[2, 1] * balls[h, 1] + T[2, 2] * balls[h, 2] + T[2, 3])
            along = -(m0 * u0 + m1 * u1 + m2 * u2)
            if m0 * m0 + m1 * m1 + m2 * m2 - along * along > balls[h, 3] * balls[h, 3] or along < -balls[h, 3]:
                continue
            # into the body's axes
            x = T[0, 0] * m0 + T[1, 0] * m1 + T[2, 0] * m2 + balls[h, 0]
            y = T[0, 1] * m0 + T[1, 1] * m1 + T[2, 1] * m2 + balls[h, 1]
            z = T[0, 2] * m0 + T[1, 2] * m1 + T[2, 2] * m2 + balls[h, 2]
            u = T[0, 0] * u0 + T[1, 0] * u1 + T[2, 0] * u2
            v = T[0, 1] * u0 + T[1, 1] * u1 + T[2, 1] * u2
            w = T[0, 2] * u0 + T[1, 2] * u1 + T[2, 2] * u2
            begin, end, face = 0.0, nearest, -1
            for k in range(first[h], first[h + 1]):
                rise = planes[k, 0] * u + planes[k, 1] * v + planes[k, 2] * w
                height = planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] * z + planes[k, 3]
                if rise < 0.0:
                    if -height / rise > begin:
                        begin, face = -height / rise, k
                elif height > 0.0 and rise == 0.0:
                    end = -1.0
                elif rise > 0.0:
                    end = min(end, -height / rise)
                if begin >= end:
                    break
            if face >= 0 and begin < end:
                nearest = begin
                n0, n1, n2 = planes[face, 0], planes[face, 1], planes[face, 2]
                for r in range(3):
                    normals[i, r] = T[r, 0] * n0 + T[r, 1] * n1 + T[r, 2] * n2
        distances[i] = nearest
