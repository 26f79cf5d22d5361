"""What a spot saw and lost still counts for a while: a ray that slips off an edge has not become safe."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.danger.compiled import Array, Vector, add, dot, entry, inline, readable, row
from qpsafe.robot.wire import Wire
from qpsafe.sensing.rules import SensingRules


class PointHold:
    """The point of every spot that counts, seen now or held.

    A nearer reading, and one that goes away no faster than `jump` a tick, counts at once. A reading that jumps farther
    away, nothing in sight, and a sick reading are not believed before they have lasted for the hold time: meanwhile the
    last point counts and moves towards its spot at the speed of a person walking, until it is d_min from the wire;
    only what may have left through the end of the range stays where it was. Without this a ray at the edge of an
    obstacle flickers: seen, the robot evades; lost, it comes back at once.

    Args:
        count: Number of spots.
        rules: Hold time, speed, jump, d_min.
        dt: Tick [s].
        range_max: Of each spot (k,) [m].
    """

    def __init__(self, count: int, rules: SensingRules, dt: float, range_max: Array) -> None:
        self._limit = rules.ticks(rules.hold_time, dt)
        self._step, self._jump, self._nearest = rules.approach_speed * dt, rules.jump, rules.d_min
        self._range_max = range_max
        self._count = count
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        k = self._count
        self.points = np.zeros((k, 3))
        self.seen = np.full(k, np.inf)  # distance at which the spot saw its point last, +inf for none
        self.age = np.zeros(k, dtype=np.int64)  # ticks since then

    def update(
        self, distances: Array, counts: NDArray[np.bool_], points: Array, origins: Array, wire: Wire
    ) -> NDArray[np.bool_]:
        """Take one tick's readings; which spots have a point that counts in `self.points` (k,).

        Args:
            distances: Readings (k,) [m]; +inf where nothing is in sight, NaN where it is not known.
            counts: Whether what is read counts, or is a known obstacle, (k,).
            points: What is read, (k, 3) [m].
            origins: Of the spots now, (k, 3) [m].
            wire: The robot's wire now.
        """
        _hold(
            distances,
            counts,
            points,
            origins,
            wire.starts,
            wire.ends,
            self._range_max,
            self._limit,
            self._step,
            self._jump,
            self._nearest,
            self.seen,
            self.age,
            self.points,
        )
        return self.seen < np.inf


@inline
def _distance_to_wire(p: Vector, r0: Array, r1: Array) -> float:
    smallest = np.inf
    for j in range(r0.shape[0]):
        d, w = add(row(r1, j), -1.0, row(r0, j)), add(p, -1.0, row(r0, j))
        dd = dot(d, d)
        l = min(max(dot(w, d) / dd, 0.0), 1.0) if dd > 0.0 else 0.0
        n = add(w, -l, d)
        smallest = min(smallest, dot(n, n))
    return np.sqrt(smallest)


@entry(
    types.void(
        readable(1),
        types.Array(types.boolean, 1, "A", readonly=True),
        readable(2),
        readable(2),
        readable(2),
        readable(2),
        readable(1),
        types.int64,
        types.float64,
        types.float64,
        types.float64,
        types.float64[::1],
        types.int64[::1],
        types.float64[:, ::1],
    )
)
def _hold(
    distances: Array,
    counts: Array,
    points: Array,
    origins: Array,
    r0: Array,
    r1: Array,
    range_max: Array,
    limit: int,
    step: float,
    jump: float,
    nearest: float,
    seen: Array,
    age: Array,
    held: Array,
) -> None:
    for i in range(distances.shape[0]):
        d = distances[i]
        known = d == d
        # NaN fails: a sick reading is never believed, only waited for
        if known and (d <= seen[i] + jump or age[i] >= limit):
            age[i] = 0
            seen[i] = d if counts[i] else np.inf
            held[i, 0], held[i, 1], held[i, 2] = row(points, i)
            continue
        if age[i] >= limit:  # sick for too long: forgotten, but never called free (the spot is dead by now)
            seen[i] = np.inf
        age[i] += 1
        if seen[i] == np.inf or (known and d > range_max[i] and seen[i] + jump > range_max[i]):
            continue  # nothing is held, or it may just have left through the end of the range: held where it was
        p = row(held, i)
        way = add(row(origins, i), -1.0, p)
        length = np.sqrt(dot(way, way))
        if length > step:
            p = add(p, step / length, way)
            if _distance_to_wire(p, r0, r1) >= nearest:
                held[i, 0], held[i, 1], held[i, 2] = p
