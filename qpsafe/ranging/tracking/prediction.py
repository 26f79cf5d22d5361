"""What a known velocity of a point may do: add danger, never take any away.

A point seen at p with the velocity ṗ counts in the field as the most dangerous of three: p at rest, as without any
velocity; p with the part of ṗ that comes nearer to the wire; and with that part the place where p has got to by now. In
the gate its ball grows by what it may do, |ṗ| + a_h t, where that is more than a person's speed v_h is.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, Vector, add, dot, entry, inline, linked, readable, row, scale
from qpsafe.danger import link_field
from qpsafe.danger.link_field import danger_field
from qpsafe.robot.kinematics import Index
from qpsafe.sensing import hold
from qpsafe.sensing.hold import from_wire

_danger_field = linked(danger_field, *link_field.USES)
USES = (link_field, *link_field.USES, hold)
#: Steps of a way to the wire.
_STEPS = 8


@inline
def person_speed(velocity: Vector, usual: float, acceleration: float, time: float, fastest: float) -> float:
    """The speed by which the ball of a point grows, for a time from now: max(v_h, |ṗ| + a_h t) [m/s].

    Args:
        velocity: ṗ of the point, zero if none is known [m/s].
        usual: v_h, of everybody [m/s].
        acceleration: a_h, of people [m/s²].
        time: t, up to which it is asked for, with the age of what was seen [s].
        fastest: Nobody is faster, if that is more than v_h [m/s].
    """
    known = sqrt(dot(velocity, velocity))
    if not known > 0.0:
        return usual
    return max(usual, min(known + acceleration * time, fastest))


@inline
def nearing(p: Vector, velocity: Vector, r0: Array, r1: Array) -> Vector:
    """The part of a velocity that comes nearer to the wire, along the shortest way to it; zero for what goes away."""
    away = from_wire(p, r0, r1)
    square = dot(away, away)
    speed = dot(velocity, away)
    return scale(speed / square, away) if speed < 0.0 and square > 0.0 else (0.0, 0.0, 0.0)


@inline
def moved(p: Vector, velocity: Vector, elapsed: float, nearest: float, r0: Array, r1: Array) -> Vector:
    """Where a point has got to, but not nearer to the wire than `nearest`: there it waits.

    It steps by as much as it can be without coming too near, as often as that takes it on (`_STEPS` at most).
    """
    size = sqrt(dot(velocity, velocity))
    left = size * elapsed
    for _ in range(_STEPS):
        away = from_wire(p, r0, r1)
        step = min(left, sqrt(dot(away, away)) - nearest)
        if not step > 0.0:
            break
        p = add(p, step / size, velocity)
        left -= step
    return p


_rows = readable(2)
_outs, _whole = types.float64[:, ::1], types.int64[::1]


@entry(
    types.void(
        _rows, _rows, types.float64[::1], types.float64, _rows, _rows, _rows, _rows, types.UniTuple(types.float64, 3),
        types.float64, types.float64[:, :, ::1], types.float64[::1], _whole, _outs, _outs,
    ),
    *USES,
)  # fmt: skip
def foresee(
    points: Array, velocities: Array, elapsed: Array, nearest: float, r0: Array, r1: Array, v0: Array, v1: Array,
    weights: Vector, floor: float, work: Array, values: Array, which: Index, places: Array, moving: Array,
) -> None:  # fmt: skip
    """Fill places and moving (p, 3) with the most dangerous place of each point, and its velocity there.

    Args:
        points, velocities, elapsed: Where each was seen, how it moved then (zero: not known), how long ago (p,).
        nearest: d_min, nothing moves nearer to the wire by itself.
        r0, r1, v0, v1: The wire, (links, 3) each.
        weights, floor: Of the field.
        work, values, which: To work in, (3, 3 p, 3), (3 p,), (p,).
        places, moving: The result.
    """  # fmt: skip
    count = 0
    for i in range(points.shape[0]):
        for c in range(3):
            places[i, c], moving[i, c] = points[i, c], 0.0
        p, v = row(points, i), row(velocities, i)
        come = nearing(p, v, r0, r1)
        now = moved(p, v, elapsed[i], nearest, r0, r1)
        comes = nearing(now, v, r0, r1)
        still = come[0] == 0.0 and come[1] == 0.0 and come[2] == 0.0
        if still and comes[0] == 0.0 and comes[1] == 0.0 and comes[2] == 0.0 and now == p:
            continue
        which[count] = i
        for c in range(3):
            work[0, 3 * count, c], work[1, 3 * count, c] = p[c], 0.0
            work[0, 3 * count + 1, c], work[1, 3 * count + 1, c] = p[c], come[c]
            work[0, 3 * count + 2, c], work[1, 3 * count + 2, c] = now[c], comes[c]
        count += 1
    if count == 0:
        return
    k = 3 * count
    _danger_field(work[0, :k], work[1, :k], r0, r1, v0, v1, weights, floor, values[:k], work[2, :k])
    for j in range(count):
        best = 3 * j
        for other in range(3 * j + 1, 3 * j + 3):
            if values[other] > values[best]:
                best = other
        for c in range(3):
            places[which[j], c], moving[which[j], c] = work[0, best, c], work[1, best, c]


class Foresight:
    """`foresee` with memory of its own, for arrays of any length up to a number of points.

    Args:
        most: Points at once.
    """

    def __init__(self, most: int) -> None:
        self.work, self.values = np.zeros((3, 3 * most, 3)), np.zeros(3 * most)
        self.which = np.zeros(most, dtype=np.int64)

    def __call__(
        self,
        points: NDArray[np.float64],
        velocities: NDArray[np.float64],
        elapsed: NDArray[np.float64],
        nearest: float,
        wire: tuple[NDArray[np.float64], ...],
        weights: Vector,
        floor: float,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Most dangerous places (p, 3) and velocities there (p, 3).

        Args:
            points: Where each was seen (p, 3) [m].
            velocities: How it moved then (p, 3) [m/s].
            elapsed: How long ago (p,) [s].
            nearest: d_min of `SensingRules` [m].
            wire: Of the robot now, `Wire`.
            weights: k1, k2, gamma of the field.
            floor: Of the field [m].
        """
        places, moving = np.empty((len(points), 3)), np.empty((len(points), 3))
        foresee(
            points, velocities, elapsed, nearest, *wire, weights, floor, self.work, self.values, self.which, places,
            moving,
        )  # fmt: skip
        return places, moving
