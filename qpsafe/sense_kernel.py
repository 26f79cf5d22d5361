"""The compiled half of `qpsafe.sense`: kinematics, sensing, danger, torque and evasion in one call."""

from __future__ import annotations

from math import nan

from numba import types

from qpsafe.danger import push
from qpsafe.danger.compiled import Array, entry, linked, readable
from qpsafe.danger.evasion import filter_by
from qpsafe.danger.memory import view
from qpsafe.danger.push import push_by
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, forward, tree_types, wire_of
from qpsafe.sensing import kernel
from qpsafe.sensing.kernel import take_readings

# each is compiled once, for Python and for this call
_forward, _wire_of = linked(forward), linked(wire_of)
_take_readings, _push_by = linked(take_readings, *kernel.USES), linked(push_by, *push.USES)
_filter_by = linked(filter_by)

_any = readable(1)
_one, _two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))
_ints, _places = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 1, "A", readonly=True)
_out, _outs, _out_ints = types.float64[::1], types.float64[:, ::1], types.int64[::1]


def work_size(memory: int, n: int, links: int, spots: int) -> int:
    """Floats that `sense_quickly` works in."""
    return memory + 12 * links + 4 * spots + n


@entry(
    types.Tuple((types.int64, types.int64, types.int64, types.float64))(
        _any, _any, _any, _any, _two, *tree_types, _places, _places,
        _ints, _ints, _three, _two, _ints, _ints, _two, _two, _one, _ints,
        types.int64[:, ::1], _outs, types.boolean[::1], _outs, _out_ints, _outs,
        types.float64, types.float64, types.float64, types.float64, readable(2), readable(2), _any,
        types.int64, _out, _outs, _out_ints, _outs, _out,
    ),
    kinematics, push, kernel, *push.USES, *kernel.USES,
)  # fmt: skip
def sense_quickly(
    q: Array, qd: Array, distances: Array, ages: Array, plausible: Array,
    parents: Index, placements: Array, axes: Array, supports: Array, end_bodies: Index, end_places: Array,
    starts: Index, stops: Index,
    bodies: Index, links: Index, rays: Array, ranges: Array, hull_bodies: Index, first: Index, planes: Array,
    balls: Array, numbers: Array, ticks: Index,
    counts: Index, seen: Array, dead: Array, held: Array, age: Index, track: Array,
    static: float, kinetic: float, gamma: float, floor: float, A: Array, B: Array, before: Array,
    size: int, work: Array, points: Array, point_links: Index, vectors: Array, qd0: Array,
) -> tuple[int, int, int, float]:  # fmt: skip
    """Fill points, point_links, vectors and qd0; arguments as for the calls below, `size` of the kinematics.

    Returns:
        How many points count, -1 if the measurement is none, and then nothing has been touched; how many spots are
        dead; how many are dead or unusable; CDF_n, NaN if anything is not finite.
    """
    n, k, m, s = q.shape[0], end_bodies.shape[0], starts.shape[0], distances.shape[0]
    for i in range(n):
        sane = plausible[0, i] <= q[i] <= plausible[1, i] and plausible[2, i] <= qd[i] <= plausible[3, i]
        if not sane:  # NaN too
            return -1, 0, 0, nan
    a = size + 12 * m
    memory, wire = view(work, 0, (size,)), view(work, size, (4, m, 3))
    velocities, values = view(work, a, (s, 3)), view(work, a + 3 * s, (s,))
    torque = view(work, a + 4 * s, (n,))
    # q, q̇ -> kinematics, wire (4)
    for i in range(n):  # contiguous
        torque[i] = q[i]
    _forward(torque, parents, placements, axes, supports, end_bodies, end_places, memory)
    _wire_of(memory, k, qd, starts, stops, wire)
    # spot distances -> detected points (7)
    count, dying, out = _take_readings(
        distances, ages, memory, wire[0], wire[1], bodies, links, rays, ranges, hull_bodies, first, planes, balls,
        numbers, ticks, counts, seen, dead, held, age, track, points, point_links, velocities,
    )  # fmt: skip
    # -> danger (1)-(6) -> virtual torque (8), (14), (15)
    moving = count if ticks[3] else 0  # no velocities: points at rest
    cdf_n = _push_by(
        view(points, 0, (count, 3)), view(velocities, 0, (moving, 3)), view(point_links, 0, (count,)),
        wire[0], wire[1], wire[2], wire[3], (static, kinetic, gamma), floor, memory, k, starts, stops,
        view(values, 0, (count,)), view(vectors, 0, (count, 3)), torque,
    )  # fmt: skip
    # -> evasive velocity (16)
    _filter_by(A, B, before, torque, qd0)
    return count, dying, out, cdf_n
