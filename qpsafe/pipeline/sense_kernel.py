"""The compiled stages of the first half of a tick, and the two calls they are composed to.

    q, q̇ --> kinematics, wire (4);   readings or points --(7), rules--> points that count
    points --(1)-(6)--> danger vectors --(8), (14), (15)--> torque --(16)--> q̇0

What does not change from tick to tick stands in two blocks, one of floats and one of integers, see `Blocks`; a call
with two arrays takes a tenth of the time of one with thirty. A field of another making is told by weights that are not
numbers: then the calls stop at the points.
"""

from __future__ import annotations

from math import isfinite, nan
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import Array, entry, inline, linked, readable
from qpsafe.compiled.memory import view
from qpsafe.danger import push
from qpsafe.danger.evasion import filter_by
from qpsafe.danger.push import push_by
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, forward, wire_of
from qpsafe.sensing import detection, readings
from qpsafe.sensing.detection import find_nearest
from qpsafe.sensing.readings import take_readings

# each is compiled once, for Python and for these calls
_forward, _wire_of, _filter_by = linked(forward), linked(wire_of), linked(filter_by)
_take_readings, _push_by = linked(take_readings, *readings.USES), linked(push_by, *push.USES)
_find_nearest = linked(find_nearest, compiled)

# the block of integers begins with sizes, then tells where each field of the two blocks begins
JOINTS, ENDS, LINKS, SPOTS, HULLS, FACES, MEMORY = range(7)
FLOATS = ("plausible", "placements", "axes", "supports", "end_places", "A", "B", "weights", "numbers", "rays", "ranges",
          "planes", "balls")  # fmt: skip
INTEGERS = ("parents", "end_bodies", "starts", "stops", "bodies", "links", "hull_bodies", "first", "ticks")
(PLAUSIBLE, PLACEMENTS, AXES, SUPPORTS, END_PLACES, A, B, WEIGHTS, NUMBERS, RAYS, RANGES, PLANES, BALLS,
 PARENTS, END_BODIES, STARTS, STOPS, BODIES, SPOT_LINKS, HULL_BODIES, FIRST, TICKS) = range(7, 7 + 22)  # fmt: skip
_HEAD = 7 + len(FLOATS) + len(INTEGERS)


def pack(sizes: tuple[int, ...], floats: dict[str, Any], integers: dict[str, Any]) -> tuple[Array, Index]:
    """The two blocks, read-only.

    Args:
        sizes: As named above.
        floats: The fields of `FLOATS`, arrays of any shape; those that are missing are empty.
        integers: Likewise of `INTEGERS`.
    """
    reals = [np.asarray(floats.get(name, ()), dtype=np.float64).ravel() for name in FLOATS]
    whole = [np.asarray(integers.get(name, ()), dtype=np.int64).ravel() for name in INTEGERS]
    places = np.cumsum([0, *map(len, reals)])[:-1], _HEAD + np.cumsum([0, *map(len, whole)])[:-1]
    blocks = np.concatenate(reals), np.concatenate((sizes, *places, *whole)).astype(np.int64)
    for block in blocks:
        block.flags.writeable = False
    return blocks


def work_size(sizes: tuple[int, ...], points: int) -> int:
    """Floats that the calls work in: kinematics, wire, torque, then the velocity of each point."""
    return sizes[MEMORY] + 12 * sizes[LINKS] + sizes[JOINTS] + 3 * points


@inline
def is_measurement(q: Array, qd: Array, f: Array, i: Index) -> bool:
    """Whether position and velocity are finite and not absurd."""
    plausible = view(f, i[PLAUSIBLE], (4, i[JOINTS]))
    sane = True
    for j in range(i[JOINTS]):
        sane = sane and plausible[0, j] <= q[j] <= plausible[1, j]  # false for NaN
        sane = sane and plausible[2, j] <= qd[j] <= plausible[3, j]
    return sane


@inline
def place_bodies(q: Array, f: Array, i: Index, memory: Array) -> None:
    """Kinematics of a configuration (n,), contiguous; see `kinematics.forward`."""
    n, k = i[JOINTS], i[ENDS]
    _forward(
        q, view(i, i[PARENTS], (n,)), view(f, i[PLACEMENTS], (n, 4, 4)), view(f, i[AXES], (n, 6)),
        view(f, i[SUPPORTS], (n + 1, n)), view(i, i[END_BODIES], (k,)), view(f, i[END_PLACES], (k, 3)), memory,
    )  # fmt: skip


@inline
def _stand(q: Array, qd: Array, f: Array, i: Index, work: Array) -> bool:
    """Kinematics and wire of a measurement; False, and nothing done, if it is none."""
    n, k, m = i[JOINTS], i[ENDS], i[LINKS]
    if not is_measurement(q, qd, f, i):
        return False
    contiguous = view(work, i[MEMORY] + 12 * m, (n,))
    for j in range(n):
        contiguous[j] = q[j]
    memory = view(work, 0, (i[MEMORY],))
    place_bodies(contiguous, f, i, memory)
    wire = view(work, i[MEMORY], (4, m, 3))
    _wire_of(memory, k, qd, view(i, i[STARTS], (m,)), view(i, i[STOPS], (m,)), wire)
    return True


@inline
def _evade(
    f: Array, i: Index, work: Array, moving: int, points: Array, links: Index, values: Array, vectors: Array,
    before: Array, qd0: Array,
) -> float:  # fmt: skip
    """Danger, torque and q̇0 of the points; CDF_n, NaN if anything is not finite, or if the field is not ours."""
    n, m = i[JOINTS], i[LINKS]
    weights = view(f, i[WEIGHTS], (4,))
    if weights[0] != weights[0]:
        return nan
    a = i[MEMORY] + 12 * m
    wire, torque = view(work, i[MEMORY], (4, m, 3)), view(work, a, (n,))
    velocities = view(work, a + n, (moving, 3))
    # danger (1)-(6) -> virtual torque (8), (14), (15)
    cdf_n = _push_by(
        points, velocities, links, wire[0], wire[1], wire[2], wire[3], (weights[0], weights[1], weights[2]), weights[3],
        view(work, 0, (i[MEMORY],)), i[ENDS], view(i, i[STARTS], (m,)), view(i, i[STOPS], (m,)),
        values, vectors, torque,
    )  # fmt: skip
    # -> evasive velocity (16)
    _filter_by(view(f, i[A], (n, n)), view(f, i[B], (n, n)), before, torque, qd0)
    for j in range(n):
        if not isfinite(qd0[j]):
            cdf_n = nan
    return cdf_n


@inline
def _append(
    count: int, more: Array, more_links: Index, more_velocities: Array, points: Array, links: Index, velocities: Array
) -> int:
    """Put more points behind the first `count`; returns how many there are then."""
    for p in range(more.shape[0]):
        links[count + p] = more_links[p]
        for c in range(3):
            points[count + p, c], velocities[count + p, c] = more[p, c], more_velocities[p, c]
    return count + more.shape[0]


_any, _block, _ints = readable(1), types.Array(types.float64, 1, "C", readonly=True), types.int64[::1]
_out, _outs, _ints_block = types.float64[::1], types.float64[:, ::1], types.Array(types.int64, 1, "C", readonly=True)
_more = (readable(2), types.Array(types.int64, 1, "A", readonly=True), readable(2))


@entry(
    types.Tuple((types.int64, types.int64, types.int64, types.float64))(
        _any, _any, _any, _any, *_more, _block, _ints_block,
        types.int64[:, ::1], _outs, types.boolean[::1], _outs, _ints, _outs,
        _any, _out, _outs, _ints, _out, _outs, _out,
    ),
    kinematics, push, readings, *push.USES, *readings.USES,
)  # fmt: skip
def sense_readings(
    q: Array, qd: Array, distances: Array, ages: Array, more: Array, more_links: Index, more_velocities: Array,
    f: Array, i: Index, counts: Index, seen: Array, dead: Array, held: Array, age: Index, track: Array,
    before: Array, work: Array, points: Array, links: Index, values: Array, vectors: Array, qd0: Array,
) -> tuple[int, int, int, float]:  # fmt: skip
    """Fill points, links, values, vectors and qd0 from the readings of k spots; their memory as for `take_readings`.

    More points (e, 3), with links and velocities, count too.

    Returns:
        How many points count, -1 if the measurement is none, and then nothing has been touched; how many spots are
        dead; how many are dead or unusable; CDF_n, see `_evade`.
    """
    if not _stand(q, qd, f, i, work):
        return -1, 0, 0, nan
    n, m, s, h = i[JOINTS], i[LINKS], i[SPOTS], i[HULLS]
    memory, wire = view(work, 0, (i[MEMORY],)), view(work, i[MEMORY], (4, m, 3))
    velocities, ticks = view(work, i[MEMORY] + 12 * m + n, (s + more.shape[0], 3)), view(i, i[TICKS], (4,))
    # spot distances -> detected points (7)
    count, dying, out = _take_readings(
        distances, ages, memory, wire[0], wire[1],
        view(i, i[BODIES], (s,)), view(i, i[SPOT_LINKS], (s,)), view(f, i[RAYS], (s, 4, 2)), view(f, i[RANGES], (s, 2)),
        view(i, i[HULL_BODIES], (h,)), view(i, i[FIRST], (h + 1,)), view(f, i[PLANES], (i[FACES], 4)),
        view(f, i[BALLS], (h, 4)), view(f, i[NUMBERS], (i[RAYS] - i[NUMBERS],)), ticks,
        counts, seen, dead, held, age, track, points, links, velocities,
    )  # fmt: skip
    count = _append(count, more, more_links, more_velocities, points, links, velocities)
    moving = count if ticks[3] else 0  # no velocities: points at rest
    cdf_n = _evade(
        f, i, work, moving, view(points, 0, (count, 3)), view(links, 0, (count,)), view(values, 0, (count,)),
        view(vectors, 0, (count, 3)), before, qd0,
    )  # fmt: skip
    return count, dying, out, cdf_n


@entry(
    types.Tuple((types.int64, types.float64))(
        _any, _any, readable(2), *_more, _block, _ints_block, _any, _out, _outs, _ints, _out, _outs, _out
    ),
    kinematics, push, detection, *push.USES,
)  # fmt: skip
def sense_points(
    q: Array, qd: Array, given: Array, more: Array, more_links: Index, more_velocities: Array, f: Array, i: Index,
    before: Array, work: Array, points: Array, links: Index, values: Array, vectors: Array, qd0: Array,
) -> tuple[int, float]:  # fmt: skip
    """Fill points, links (the nearest), values, vectors and qd0 from given points (p, 3) at rest, and more that move.

    Returns:
        How many points there are, -1 if the measurement is none, -2 if a point is not finite; CDF_n, see `_evade`.
    """
    if not _stand(q, qd, f, i, work):
        return -1, nan
    wire, count, total = view(work, i[MEMORY], (4, i[LINKS], 3)), given.shape[0], given.shape[0] + more.shape[0]
    velocities = view(work, i[MEMORY] + 12 * i[LINKS] + i[JOINTS], (total, 3))
    for p in range(count):
        for c in range(3):
            points[p, c] = given[p, c]
    if not _find_nearest(view(points, 0, (count, 3)), wire[0], wire[1], view(links, 0, (count,))):
        return -2, nan
    moving = 0
    if total > count:
        for p in range(count):
            for c in range(3):
                velocities[p, c] = 0.0
        moving = _append(count, more, more_links, more_velocities, points, links, velocities)
    return total, _evade(f, i, work, moving, points, links, values, vectors, before, qd0)


Blocks = tuple[NDArray[np.float64], NDArray[np.int64]]
