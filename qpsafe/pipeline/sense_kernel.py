"""The compiled stages of the first half of a tick, and the two calls they are composed to.

    q, q̇ --> kinematics, wire (4);   readings or points --(7), rules--> points that count
    points --(1)-(6)--> danger vectors --(8), (14), (15)--> torque --(16), friction--> q̇0

What does not change from tick to tick stands in two blocks, one of floats and one of integers, see `Blocks`; a call
with two arrays takes a tenth of the time of one with thirty. A field of another making is told by weights that are not
numbers: then the calls stop at the points.
"""

from __future__ import annotations

from math import inf, isfinite, nan, sqrt
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import Array, entry, inline, linked, readable, row
from qpsafe.compiled.memory import view
from qpsafe.danger import link_field, push
from qpsafe.danger.evasion import filter_by, rub
from qpsafe.danger.link_field import danger_field
from qpsafe.danger.push import push_vectors
from qpsafe.ranging import ranged
from qpsafe.ranging.ranged import DANGER, GRADIENT, PLACE, VELOCITY
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, forward, wire_of
from qpsafe.robot.wire import Wire
from qpsafe.sensing import detection, readings, velocity
from qpsafe.sensing.detection import find_nearest
from qpsafe.sensing.readings import take_readings
from qpsafe.sensing.velocity import unsettled_compiled as _unsettled

# each is compiled once, for Python and for these calls
_forward, _wire_of, _filter_by, _rub = linked(forward), linked(wire_of), linked(filter_by), linked(rub)
_take_readings, _push_vectors = linked(take_readings, *readings.USES), linked(push_vectors, *push.USES)
_find_nearest, _danger_field = linked(find_nearest, compiled), linked(danger_field, *link_field.USES)

# the block of integers begins with sizes, then tells where each field of the two blocks begins
JOINTS, ENDS, LINKS, SPOTS, HULLS, FACES, MEMORY = range(7)
FLOATS = ("plausible", "placements", "axes", "supports", "end_places", "A", "B", "drop", "weights", "numbers", "rays",
          "ranges", "planes", "balls")  # fmt: skip
INTEGERS = ("parents", "end_bodies", "starts", "stops", "bodies", "links", "hull_bodies", "first", "ticks")
(PLAUSIBLE, PLACEMENTS, AXES, SUPPORTS, END_PLACES, A, B, DROP, WEIGHTS, NUMBERS, RAYS, RANGES, PLANES, BALLS,
 PARENTS, END_BODIES, STARTS, STOPS, BODIES, SPOT_LINKS, HULL_BODIES, FIRST, TICKS) = range(7, 7 + 23)  # fmt: skip
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


def bodies_and_wire(sizes: tuple[int, ...], work: Array) -> tuple[Array, Wire]:
    """Poses of the robot's bodies (n + 1, 4, 4), and its wire, in the memory that the calls work in."""
    n, m, memory = sizes[JOINTS], sizes[LINKS], sizes[MEMORY]
    wire = work[memory : memory + 12 * m].reshape(4, m, 3)
    return work[: 16 * (n + 1)].reshape(n + 1, 4, 4), Wire(*wire)


_any, _block, _out = readable(1), types.Array(types.float64, 1, "C", readonly=True), types.float64[::1]
_ints_block = types.Array(types.int64, 1, "C", readonly=True)


@entry(types.boolean(_any, _any, _block, _ints_block, _out), kinematics)
def stand(q: Array, qd: Array, f: Array, i: Index, work: Array) -> bool:
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


_stand = linked(stand, kinematics)


@inline
def _coming(own: int, velocities: Array, more: Array, track: Array) -> float:
    """How fast the fastest point moves [m/s], infinite where that is not known of one, or not yet."""
    if own > velocities.shape[0] or _unsettled(track):
        return inf
    most = 0.0
    for p in range(own):
        v = row(velocities, p)
        most = max(most, v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    for p in range(more.shape[0]):
        most = max(most, more[p, VELOCITY] ** 2 + more[p, VELOCITY + 1] ** 2 + more[p, VELOCITY + 2] ** 2)
    return sqrt(most)


@inline
def _evade(
    f: Array, i: Index, work: Array, moving: int, more: Array, points: Array, links: Index, values: Array,
    vectors: Array, before: Array, track: Array, qd0: Array,
) -> float:  # fmt: skip
    """Danger, torque and q̇0 of the points; CDF_n, NaN if anything is not finite, or if the field is not ours.

    The danger of the last points, `more`, is known already; as many of the others as `moving` says move, and `track`
    tells which spots have seen theirs for long enough to know.
    """
    n, m = i[JOINTS], i[LINKS]
    weights = view(f, i[WEIGHTS], (4,))
    if weights[0] != weights[0]:
        return nan
    a, own = i[MEMORY] + 12 * m, points.shape[0] - more.shape[0]
    wire, torque = view(work, i[MEMORY], (4, m, 3)), view(work, a, (n,))
    # danger (1)-(5) and its gradients
    _danger_field(
        view(points, 0, (own, 3)), view(work, a + n, (moving, 3)), wire[0], wire[1], wire[2], wire[3],
        (weights[0], weights[1], weights[2]), weights[3], view(values, 0, (own,)), view(vectors, 0, (own, 3)),
    )  # fmt: skip
    for p in range(more.shape[0]):
        values[own + p] = more[p, DANGER]
        for c in range(3):
            vectors[own + p, c] = more[p, GRADIENT + c]
    # -> virtual torque (6), (8), (14), (15)
    cdf_n = _push_vectors(
        values, links, view(work, 0, (i[MEMORY],)), i[ENDS], view(i, i[STARTS], (m,)), view(i, i[STOPS], (m,)), vectors,
        torque,
    )  # fmt: skip
    # -> evasive velocity (16)
    _filter_by(view(f, i[A], (n, n)), view(f, i[B], (n, n)), before, torque, qd0)
    for j in range(n):
        if not isfinite(qd0[j]):
            cdf_n = nan
    _rub(qd0, view(f, i[DROP], (n,)), _coming(own, view(work, a + n, (moving, 3)), more, track))
    return cdf_n


@inline
def _append(count: int, more: Array, more_links: Index, points: Array, links: Index, velocities: Array) -> int:
    """Put more points behind the first `count`; returns how many there are then."""
    for p in range(more.shape[0]):
        links[count + p] = more_links[p]
        for c in range(3):
            points[count + p, c], velocities[count + p, c] = more[p, PLACE + c], more[p, VELOCITY + c]
    return count + more.shape[0]


#: All the code that goes into both calls, but for the points.
USES = (kinematics, push, ranged, velocity, *push.USES, link_field, *link_field.USES)
_ints, _outs = types.int64[::1], types.float64[:, ::1]
_more = (readable(2), types.Array(types.int64, 1, "A", readonly=True))


@entry(
    types.Tuple((types.int64, types.int64, types.int64, types.float64))(
        _any, _any, _any, _any, *_more, _block, _ints_block,
        types.int64[:, ::1], _outs, types.boolean[::1], _outs, _ints, _outs,
        _any, _out, _outs, _ints, _out, _outs, _out,
    ),
    *USES, readings, *readings.USES,
)  # fmt: skip
def sense_readings(
    q: Array, qd: Array, distances: Array, ages: Array, more: Array, more_links: Index, f: Array, i: Index,
    counts: Index, seen: Array, dead: Array, held: Array, age: Index, track: Array,
    before: Array, work: Array, points: Array, links: Index, values: Array, vectors: Array, qd0: Array,
) -> tuple[int, int, int, float]:  # fmt: skip
    """Fill points, links, values, vectors and qd0 from the readings of k spots; their memory as for `take_readings`.

    More points (e, COLUMNS), see `Ranged`, with their links, count too.

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
    moving = count if ticks[3] else 0  # no velocities: points at rest
    count = _append(count, more, more_links, points, links, velocities)
    cdf_n = _evade(
        f, i, work, moving, more, view(points, 0, (count, 3)), view(links, 0, (count,)), view(values, 0, (count,)),
        view(vectors, 0, (count, 3)), before, track, qd0,
    )  # fmt: skip
    return count, dying, out, cdf_n


@entry(
    types.Tuple((types.int64, types.float64))(
        _any, _any, readable(2), *_more, _block, _ints_block, _any, _out, _outs, _ints, _out, _outs, _out
    ),
    *USES, detection,
)  # fmt: skip
def sense_points(
    q: Array, qd: Array, given: Array, more: Array, more_links: Index, f: Array, i: Index, before: Array,
    work: Array, points: Array, links: Index, values: Array, vectors: Array, qd0: Array,
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
    if total > count:
        for p in range(count):
            for c in range(3):
                velocities[p, c] = 0.0
        _append(count, more, more_links, points, links, velocities)
    return total, _evade(f, i, work, 0, more, points, links, values, vectors, before, view(work, 0, (0, 1)), qd0)


Blocks = tuple[NDArray[np.float64], NDArray[np.int64]]
