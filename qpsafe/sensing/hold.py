"""What a spot saw and lost still counts for a while: a ray that slips off an edge has not become safe."""

from __future__ import annotations

import numpy as np

from qpsafe.compiled.compiled import Array, Vector, add, dot, inline, row
from qpsafe.fixed import Fixed
from qpsafe.sensing.rules import SensingRules


class PointHold(Fixed):
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
    """

    fixed = frozenset(("ticks", "step"))

    def __init__(self, count: int, rules: SensingRules, dt: float) -> None:
        self.ticks = rules.ticks(rules.hold_time, dt)
        self.step = rules.approach_speed * dt
        #: Columns: distance at which each spot saw its point last, +inf for none, and the point.
        self.held = np.empty((count, 4))
        self.age = np.empty(count, dtype=np.int64)  # ticks since then
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.held[:], self.age[:] = 0.0, 0
        self.held[:, 0] = np.inf


@inline
def from_wire(p: Vector, r0: Array, r1: Array) -> Vector:
    """From the nearest point of the wire to p."""
    smallest, nearest = np.inf, (np.inf, 0.0, 0.0)
    for j in range(r0.shape[0]):
        d, w = add(row(r1, j), -1.0, row(r0, j)), add(p, -1.0, row(r0, j))
        dd = dot(d, d)
        l = min(max(dot(w, d) / dd, 0.0), 1.0) if dd > 0.0 else 0.0
        n = add(w, -l, d)
        nn = dot(n, n)
        if nn < smallest:
            smallest, nearest = nn, n
    return nearest


@inline
def believe(
    i: int,
    d: float,
    counts: bool,
    p: Vector,
    origin: Vector,
    r0: Array,
    r1: Array,
    range_max: float,
    limit: int,
    step: float,
    jump: float,
    nearest: float,
    held: Array,
    age: Array,
) -> bool:
    """Take spot i's reading; whether a point of it counts now, in `held`.

    Args:
        i: Number of the spot.
        d: Reading [m]; +inf where nothing is in sight, NaN where it is not known.
        counts: Whether what is read counts, or is a known obstacle.
        p: What is read.
        origin: Of the spot now.
        r0, r1: Starts and ends of the robot's wire now.
        range_max: Of the spot.
        limit, step, jump, nearest: Of the rules: hold time in ticks, way in a tick, jump, d_min.
        held, age: As in `PointHold`.
    """  # fmt: skip
    known = d == d
    # NaN fails: a sick reading is never believed, only waited for
    if known and (d <= held[i, 0] + jump or age[i] >= limit):
        age[i] = 0
        held[i, 0] = d if counts else np.inf
        held[i, 1], held[i, 2], held[i, 3] = p
        return counts
    if age[i] >= limit:  # sick for too long: forgotten, but never called free (the spot is dead by now)
        held[i, 0] = np.inf
    age[i] += 1
    if held[i, 0] == np.inf:
        return False
    if known and d > range_max and held[i, 0] + jump > range_max:
        return True  # it may just have left through the end of the range: held where it was
    q = held[i, 1], held[i, 2], held[i, 3]
    way = add(origin, -1.0, q)
    length = np.sqrt(dot(way, way))
    if length > step:
        q = add(q, step / length, way)
        away = from_wire(q, r0, r1)
        if np.sqrt(dot(away, away)) >= nearest:
            held[i, 1], held[i, 2], held[i, 3] = q
    return True
