"""References of compiled tasks: trajectories as knots, their events, and how far frames are from them."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from qpsafe.batch import code
from qpsafe.compiled.compiled import Array, Vector, add, inline, scale
from qpsafe.tasks.offset import offset_into, turned, turning


@inline
def _three(row: Array, first: int) -> Vector:
    return row[first], row[first + 1], row[first + 2]


@inline
def _place(row: Array) -> Vector:
    return row[code.POSE + 3], row[code.POSE + 7], row[code.POSE + 11]


@inline
def hermite(v0: Vector, way: Vector, v1: Vector, h: float, s: float) -> tuple[Vector, Vector]:
    """Way and velocity at the share s of a cubic that goes `way` in the time h, with velocities v0 and v1 at its ends.

    x(s) = h v0 s + (3 way - h (2 v0 + v1)) s² + (h (v0 + v1) - 2 way) s³
    """
    a, both = scale(h, v0), add(scale(h, v0), h, v1)
    b, c = add(add(scale(3.0, way), -1.0, a), -1.0, both), add(both, -2.0, way)
    x = scale(s, add(a, s, add(b, s, c)))
    rate = scale(1.0 / h, add(a, s, add(scale(2.0, b), 3.0 * s, c)))
    return x, rate


@inline
def interpolate(times: Array, knots: Array, time: float, goal: Array, twist: Array) -> None:
    """Pose (4, 4) and twist (6,) at a time from knots (K, `KNOT`); those of the last one after it."""
    k, last = 0, times.shape[0] - 1
    high = last
    while high - k > 1:
        middle = (k + high) // 2
        if times[middle] <= time:
            k = middle
        else:
            high = middle
    if not time < times[last]:
        k = last
    row = knots[k]
    for a in range(4):
        for b in range(4):
            goal[a, b] = row[code.POSE + 4 * a + b]
    for c in range(6):
        twist[c] = row[code.TWIST + c]
    if k == last or time == times[k]:
        return
    after, h = knots[k + 1], times[k + 1] - times[k]
    s = (time - times[k]) / h
    step = add(_place(after), -1.0, _place(row))
    x, v = hermite(_three(row, code.TWIST), step, _three(after, code.TWIST), h, s)
    # the rotation about the left knot, exp(θ(s)) R_0: θ begins at 0 with the rate ω_0
    theta, rate = hermite(_three(row, code.TWIST + 3), _three(row, code.TURN), _three(row, code.TURN_RATE), h, s)
    w = turning(theta, rate)
    for c in range(3):
        goal[c, 3] += x[c]
        twist[c], twist[3 + c] = v[c], w[c]
        column = turned(theta, (row[code.POSE + c], row[code.POSE + 4 + c], row[code.POSE + 8 + c]))
        goal[0, c], goal[1, c], goal[2, c] = column


@inline
def sample_all(p: Any, w: Any, time: float) -> None:
    """Sample every trajectory into `goals` and `twists`."""
    for path in range(p.kinds.shape[0]):
        first, stop = p.first_knot[path], p.first_knot[path + 1]
        here = time % p.periods[path] if p.kinds[path] == code.CYCLES else time
        interpolate(p.times[first:stop], p.knots[first:stop], here, w.goals[path], w.twists[path])


@inline
def measure(p: Any, w: Any) -> None:
    """Fill `offsets` of the tasks' frames, at `poses`, from the samples."""
    for k in range(p.gains.shape[0]):
        offset_into(w.poses[k], w.goals[p.paths[k]], w.offsets[k])


@inline
def error_norm(p: Any, offset: Array, task: int) -> float:
    """Norm of a task's error, by the offset (6,) of its frame."""
    first, square = p.ends[task - 1] if task > 0 else 0, 0.0
    for row in range(first, p.ends[task]):
        square += offset[p.rows[row]] * offset[p.rows[row]]
    return sqrt(square)


@inline
def event_time(p: Any, path: int, number: int) -> float:
    """When event `number` of a trajectory happens, cycles counted through; infinite if there is none [s]."""
    first, count = p.first_event[path], p.first_event[path + 1] - p.first_event[path]
    if count == 0 or (number >= count and p.kinds[path] != code.CYCLES):
        return inf
    return p.event_times[first + number % count] + (number // count) * p.periods[path]
