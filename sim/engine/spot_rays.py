"""What ideal distance sensors read, compiled: the nearest surface in the cone of each spot.

A cone is looked into along its axis and along `RING` rays on its mantle, as `qpsafe.sim.world.rays` casts them with
MuJoCo. What lies in a ball that the cone does not touch is passed over.
"""

from __future__ import annotations

from math import cos, inf, isfinite, nan, pi, sin, sqrt

import numpy as np
from numba import types

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, entry, inline, row
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, place
from qpsafe.sensing import spots
from qpsafe.sensing.spots import ray_of
from qpsafe.sim.engine import layout, ray_shapes
from qpsafe.sim.engine.layout import BALL, BODY, CASE, KIND, MESH, PLANE, SCENE_BODY, SEEN, SIZE
from qpsafe.sim.engine.ray_shapes import ray_box, ray_capsule, ray_mesh, ray_primitive

RING = 6  # rays on the mantle of a cone, besides its axis
_RINGS = np.array([(cos(2.0 * pi * i / RING), sin(2.0 * pi * i / RING)) for i in range(RING)])

USES = (kinematics, spots, layout, ray_shapes)

_ints, _rows = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 2, "C", readonly=True)
_one, _two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))


@inline
def _ray(a: Vector, u: Vector, v: Vector, slant: float, i: int) -> Vector:
    """Direction of ray i of a cone: the axis, or one of those on the mantle."""
    if i > 0 and slant > 0.0:
        a = add(add(a, slant * _RINGS[i - 1, 0], u), slant * _RINGS[i - 1, 1], v)
    s = 1.0 / sqrt(dot(a, a))
    return s * a[0], s * a[1], s * a[2]


@inline
def _touches(o: Vector, a: Vector, sine: float, cosine: float, reach: float, c: Vector, r: float) -> bool:
    """Whether a cone, cut off at `reach`, touches the ball (c, r); true in doubt."""
    c = add(c, -1.0, o)
    along = dot(c, a)
    r += 1e-9
    if along < -r or along > reach + r:
        return False
    across = sqrt(max(dot(c, c) - along * along, 0.0))
    # the distance of a point from the mantle is across cos α - along sin α
    return across * cosine - along * sine <= r


@inline
def _into(T: Array, v: Vector) -> Vector:
    """A direction in the axes of a frame at T."""
    return (
        T[0, 0] * v[0] + T[1, 0] * v[1] + T[2, 0] * v[2],
        T[0, 1] * v[0] + T[1, 1] * v[1] + T[2, 1] * v[2],
        T[0, 2] * v[0] + T[1, 2] * v[1] + T[2, 2] * v[2],
    )


@inline
def _turned(T: Array, shape: Array, v: Vector) -> Vector:
    """A direction in the axes of a shape that is carried by a body at T."""
    x, y, z = _into(T, v)
    return (
        shape[0] * x + shape[4] * y + shape[8] * z,
        shape[1] * x + shape[5] * y + shape[9] * z,
        shape[2] * x + shape[6] * y + shape[10] * z,
    )


@inline
def _look_at(
    o: Vector, a: Vector, u: Vector, v: Vector, slant: float, best: float, T: Array, kind: Index, shape: Array,
    planes: Array, faces: Index, triangles: Array,
) -> float:  # fmt: skip
    """The nearest point of a shape in a cone, if nearer than `best`."""
    c = place(T, shape[3], shape[7], shape[11])
    o = _turned(T, shape, add(o, -1.0, c))
    a, u, v = _turned(T, shape, a), _turned(T, shape, u), _turned(T, shape, v)
    for i in range(RING + 1 if slant > 0.0 else 1):
        d = _ray(a, u, v, slant, i)
        if kind[KIND] == MESH:
            inner = (o[0] - shape[CASE], o[1] - shape[CASE + 1], o[2] - shape[CASE + 2])
            # the box around it, a little larger: it is met wherever the mesh is
            grown = 1.0 + 1e-9
            t = ray_box(inner, d, grown * shape[CASE + 3], grown * shape[CASE + 4], grown * shape[CASE + 5])
            if t < inf:
                t = ray_mesh(o, d, best, kind, planes, faces, triangles)
        else:
            t = ray_primitive(kind[KIND], o, d, shape[SIZE], shape[SIZE + 1], shape[SIZE + 2])
        best = min(best, t)
    return best


@entry(
    types.void(
        _three, _ints, _ints, _three, _one, _one,
        _rows, _two, _two, _ints, _two,
        _three, _one, _two, _three, _two,
        types.float64[:, ::1], types.float64[::1], types.int64[::1],
    ),
    *USES, compiled,
)  # fmt: skip
def read_spots(
    poses: Array,
    bodies: Index,
    unseen: Index,
    rays: Array,
    reaches: Array,
    slants: Array,
    index: Index,
    shapes: Array,
    planes: Array,
    faces: Index,
    triangles: Array,
    ends: Array,
    radii: Array,
    balls: Array,
    boards: Array,
    half_sizes: Array,
    work: Array,
    distances: Array,
    hits: Index,
) -> None:
    """Read k spots.

    Args:
        poses: Of the world's bodies, (b, 4, 4): `kinematics.cut(memory, n, ends)[0]`, `RobotState.body_poses()`.
        bodies, unseen, rays, reaches, slants: The spots, see `SpotTable`.
        index, shapes, planes, faces, triangles: The world, see `World.seen`.
        ends, radii, balls, boards, half_sizes: People, see `PersonTracks.row`.
        work: At least (g, 4), for g shapes.
        distances: Filled with the distances read, (k,) [m]: +inf where nothing is in reach, NaN where the spot's ray
            is not finite.
        hits: Filled with what was met, (k,): the number of a shape of the world, g + the number of a person's
            capsule, or g + the number of capsules + that of a board; -1 for nothing.
    """
    count, segments, people = index.shape[0], radii.shape[0], balls.shape[0]
    each = segments // people if people else 0
    for g in range(count):
        x, y, z = place(poses[index[g, BODY]], shapes[g, BALL], shapes[g, BALL + 1], shapes[g, BALL + 2])
        work[g, 0], work[g, 1], work[g, 2], work[g, 3] = x, y, z, shapes[g, BALL + 3]
    for i in range(bodies.shape[0]):
        o, a = ray_of(poses[bodies[i]], rays[i])
        hits[i] = -1
        if not (isfinite(dot(o, o)) and 0.0 < dot(a, a) < inf):
            distances[i] = nan
            continue
        # u = a × e / |a × e| with e the x axis, or the y axis where a is near x; v = a × u
        u = (0.0, a[2], -a[1]) if abs(a[0]) < 0.8 else (-a[2], 0.0, a[0])
        s = 1.0 / sqrt(dot(u, u))
        u = (s * u[0], s * u[1], s * u[2])
        v = cross(a, u)
        slant, best = slants[i], np.nextafter(reaches[i], inf)  # what is as far as that is seen
        cosine = 1.0 / sqrt(1.0 + slant * slant)
        sine = slant * cosine
        for g in range(count):
            if index[g, SCENE_BODY] == unseen[i] or not index[g, SEEN]:
                continue
            if index[g, KIND] == PLANE or _touches(o, a, sine, cosine, best, row(work, g), work[g, 3]):
                t = _look_at(
                    o, a, u, v, slant, best, poses[index[g, BODY]], index[g], shapes[g], planes, faces, triangles
                )
                if t < best:
                    best, hits[i] = t, g
        for p in range(people):
            if not _touches(o, a, sine, cosine, best, row(balls, p), balls[p, 3]):
                continue
            for j in range(each * p, each * (p + 1)):
                start = row(ends[j], 0)
                axis = add(row(ends[j], 1), -1.0, start)
                r = radii[j] + 0.5 * sqrt(dot(axis, axis))
                if not _touches(o, a, sine, cosine, best, add(start, 0.5, axis), r):
                    continue
                for k in range(RING + 1 if slant > 0.0 else 1):
                    t = ray_capsule(o, _ray(a, u, v, slant, k), start, axis, radii[j])
                    if t < best:
                        best, hits[i] = t, count + j
        for b in range(boards.shape[0]):
            T = boards[b]
            c, half = (T[0, 3], T[1, 3], T[2, 3]), row(half_sizes, b)
            if _touches(o, a, sine, cosine, best, c, sqrt(dot(half, half))):
                for k in range(RING + 1 if slant > 0.0 else 1):
                    d, m = _ray(a, u, v, slant, k), add(o, -1.0, c)
                    t = ray_box(_into(T, m), _into(T, d), half[0], half[1], half[2])
                    if t < best:
                        best, hits[i] = t, count + segments + b
        distances[i] = best if hits[i] >= 0 else inf
