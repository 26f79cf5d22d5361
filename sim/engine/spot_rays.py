"""What ideal distance sensors read, compiled: the nearest surface in the cone of each spot.

A cone is looked into along its axis and along `RING` rays on its mantle, as `qpsafe.sim.world.rays` casts them with
MuJoCo. What lies in a ball that the cone does not touch is passed over.
"""

from __future__ import annotations

from math import cos, inf, isfinite, nan, pi, sin, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, entry, inline, row
from qpsafe.compiled.memory import view
from qpsafe.geometry import layout
from qpsafe.geometry.layout import BALL, BODY, CASE, KIND, MESH, NODES, NODES_FROM, PLANE, SCENE_BODY, SEEN, SIZE
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, place
from qpsafe.sensing.skin import spots
from qpsafe.sensing.skin.spots import ray_of
from qpsafe.sim.engine import ray_mesh, ray_shapes
from qpsafe.sim.engine.ray_mesh import cone_mesh
from qpsafe.sim.engine.ray_shapes import ray_box, ray_capsule, ray_primitive

if TYPE_CHECKING:
    from qpsafe.sim.engine.spot_table import SpotTable
    from qpsafe.sim.engine.world import World

RING = 6  # rays on the mantle of a cone, besides its axis
RAYS = RING + 1
_RINGS = np.array([(cos(2.0 * pi * i / RING), sin(2.0 * pi * i / RING)) for i in range(RING)])

USES = (compiled, kinematics, spots, layout, ray_mesh, ray_shapes)

_ints, _rows = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 2, "C", readonly=True)
_one, _two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))


def work_size(index: Index) -> int:
    """Numbers that `read_spots` works in, given the `World.index`."""
    return 4 * len(index) + 6 * RAYS


@inline
def _fill_fan(a: Vector, sine: float, cosine: float, fan: Array) -> None:
    """Directions of the rays in a cone around the unit vector a: the axis, and those on the mantle, (n, 3)."""
    # u = a × e / |a × e| with e the x axis, or the y axis where a is near x; v = a × u
    u = (0.0, a[2], -a[1]) if abs(a[0]) < 0.8 else (-a[2], 0.0, a[0])
    s = 1.0 / sqrt(dot(u, u))
    u = (s * u[0], s * u[1], s * u[2])
    v = cross(a, u)
    fan[0, 0], fan[0, 1], fan[0, 2] = a
    for i in range(1, fan.shape[0]):
        x, y = sine * _RINGS[i - 1, 0], sine * _RINGS[i - 1, 1]
        for k in range(3):
            fan[i, k] = cosine * a[k] + x * u[k] + y * v[k]


@inline
def _touches(o: Vector, a: Vector, sine: float, cosine: float, reach: float, c: Vector, r: float) -> bool:
    """Whether a cone, cut off at `reach`, touches the ball (c, r); true in doubt."""
    c = add(c, -1.0, o)
    along = dot(c, a)
    r += 1e-9
    # the distance of a point from the mantle is across cos α - along sin α
    across = r + along * sine
    return (
        -r <= along <= reach + r and (dot(c, c) - along * along) * cosine * cosine <= across * across and across >= 0.0
    )


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
def _faces_plane(o: Vector, a: Vector, sine: float, cosine: float, reach: float, T: Array, shape: Array) -> bool:
    """Whether a cone, cut off at `reach`, touches a plane from above."""
    height = _turned(T, shape, add(o, -1.0, place(T, shape[3], shape[7], shape[11])))[2]
    rise = _turned(T, shape, a)[2]
    # the steepest direction of the cone falls by sin (α + the angle between axis and plane), or straight down
    fall = sine * sqrt(max(1.0 - rise * rise, 0.0)) - rise * cosine if rise > -cosine else 1.0
    return 0.0 <= height <= reach * fall + 1e-9


@inline
def _look_at(
    o: Vector, sine: float, best: float, fan: Array, T: Array, kind: Index, shape: Array,
    boxes: Array, nodes: Index, triangles: Array, own: Array,
) -> float:  # fmt: skip
    """The nearest point of a shape in a cone, if nearer than `best`."""
    o = _turned(T, shape, add(o, -1.0, place(T, shape[3], shape[7], shape[11])))
    if kind[KIND] != PLANE:
        # the box around the shape, grown by as much as a cone is wide, is met by its axis wherever it is by the cone
        inner, wide = add(o, -1.0, (shape[CASE], shape[CASE + 1], shape[CASE + 2])), best * sine + 1e-9
        a, b, c = shape[CASE + 3] + wide, shape[CASE + 4] + wide, shape[CASE + 5] + wide
        if ray_box(inner, _turned(T, shape, row(fan, 0)), a, b, c) == inf:
            return best
    own = view(own, 0, (fan.shape[0], 3))
    for i in range(fan.shape[0]):
        own[i, 0], own[i, 1], own[i, 2] = _turned(T, shape, row(fan, i))
    if kind[KIND] == MESH:
        first = kind[NODES_FROM]
        return cone_mesh(o, own, sine, best, first, first + kind[NODES], boxes, nodes, triangles)
    for i in range(fan.shape[0]):
        best = min(best, ray_primitive(kind[KIND], o, row(own, i), shape[SIZE], shape[SIZE + 1], shape[SIZE + 2]))
    return best


@entry(
    types.void(
        _three, _ints, _ints, _three, _one, _one,
        _rows, _two, _two, _rows, _two,
        _three, _one, _two, _three, _two,
        types.float64[::1], types.float64[::1], types.int64[::1],
    ),
    *USES,
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
    boxes: Array,
    nodes: Index,
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
        index, shapes, boxes, nodes, triangles: The world, see `World.seen`.
        ends, radii, balls, boards, half_sizes: People, see `PersonTracks.row`.
        work: As many numbers as `work_size` tells.
        distances: Filled with the distances read, (k,) [m]: +inf where nothing is in reach, NaN where the spot's ray
            is not finite.
        hits: Filled with what was met, (k,): the number of a shape of the world, g + the number of a person's
            capsule, or g + the number of capsules + that of a board; -1 for nothing.
    """
    count, segments, people = index.shape[0], radii.shape[0], balls.shape[0]
    each = segments // people if people else 0
    globes, own = view(work, 0, (count, 4)), view(work, 4 * count + 3 * RAYS, (RAYS, 3))
    for g in range(count):
        x, y, z = place(poses[index[g, BODY]], shapes[g, BALL], shapes[g, BALL + 1], shapes[g, BALL + 2])
        globes[g, 0], globes[g, 1], globes[g, 2], globes[g, 3] = x, y, z, shapes[g, BALL + 3]
    for i in range(bodies.shape[0]):
        o, a = ray_of(poses[bodies[i]], rays[i])
        hits[i] = -1
        if not (isfinite(dot(o, o)) and 0.0 < dot(a, a) < inf):
            distances[i] = nan
            continue
        slant, best = slants[i], np.nextafter(reaches[i], inf)  # what is as far as that is seen
        cosine = 1.0 / sqrt(1.0 + slant * slant)
        sine = slant * cosine
        fan = view(work, 4 * count, (RAYS if slant > 0.0 else 1, 3))
        s = 1.0 / sqrt(dot(a, a))
        a = (s * a[0], s * a[1], s * a[2])
        _fill_fan(a, sine, cosine, fan)
        for g in range(count):
            if index[g, SCENE_BODY] == unseen[i] or not index[g, SEEN]:
                continue
            T = poses[index[g, BODY]]
            if index[g, KIND] == PLANE:
                touches = _faces_plane(o, a, sine, cosine, best, T, shapes[g])
            else:
                touches = _touches(o, a, sine, cosine, best, row(globes, g), globes[g, 3])
            if touches:
                t = _look_at(o, sine, best, fan, T, index[g], shapes[g], boxes, nodes, triangles, own)
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
                if ray_capsule(o, a, start, axis, radii[j] + best * sine + 1e-9) == inf:
                    continue
                for k in range(fan.shape[0]):
                    t = ray_capsule(o, row(fan, k), start, axis, radii[j])
                    if t < best:
                        best, hits[i] = t, count + j
        for b in range(boards.shape[0]):
            T = boards[b]
            c, half = (T[0, 3], T[1, 3], T[2, 3]), row(half_sizes, b)
            if _touches(o, a, sine, cosine, best, c, sqrt(dot(half, half))):
                m = _into(T, add(o, -1.0, c))
                for k in range(fan.shape[0]):
                    t = ray_box(m, _into(T, row(fan, k)), half[0], half[1], half[2])
                    if t < best:
                        best, hits[i] = t, count + segments + b
        distances[i] = best if hits[i] >= 0 else inf


class SpotReader:
    """What the spots read, for Python; it owns what the kernel works in.

    Args:
        world: The world.
        table: The spots.
    """

    def __init__(self, world: World, table: SpotTable) -> None:
        self._table, self._seen = table, world.seen
        self._work = np.empty(work_size(world.index))

    def read(
        self, poses: Array, people: tuple[Array, ...], reach: ArrayLike | None = None
    ) -> tuple[Array, NDArray[np.int64]]:
        """Distances read, (k,) [m], and what was met, (k,), as `read_spots` says.

        Args:
            poses: Of the world's bodies, (b, 4, 4) [m], see `World`.
            people: A row of `PersonTracks`.
            reach: Another reach than that of the table, (k,) or one number [m].
        """
        table = self._table
        if reach is not None:
            table = table._replace(reaches=np.full(len(table.bodies), reach, dtype=np.float64))
        distances, hits = np.empty(len(table.bodies)), np.empty(len(table.bodies), dtype=np.int64)
        read_spots(np.ascontiguousarray(poses), *table, *self._seen, *people, self._work, distances, hits)
        return distances, hits
