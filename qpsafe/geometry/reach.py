"""How far the robot's bodies can come until its joints stand, compiled: what cannot come near has no row."""

from __future__ import annotations

from math import floor, inf, sqrt
from typing import Any

from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, inline
from qpsafe.geometry.layout import BALL, BODY, PLANES, PLANES_FROM
from qpsafe.geometry.nearness import FEW
from qpsafe.robot.kinematics import place

LOOKS = 8  # times at which the way of a braking robot is looked at, the last one when it stands


@inline
def braking_way(v: float, a: float, dt: float, ticks: float) -> float:
    """How far a speed v >= 0 leads in some ticks that is held for the first one and then reduced by a dt each tick.

    dt Σ_{j=0..m-1} (v - j a dt), m being the whole ticks, or those until it stands: k + 1 with k = floor(v/(a dt)); and
    of the tick that has begun its part. Continuous in v and ticks. With all ticks the inverse of `stopping_speed`.
    """
    whole = floor(min(ticks, floor(v / (a * dt)) + 1.0))
    rest = min(ticks - whole, 1.0) * max(v - whole * a * dt, 0.0)
    return dt * (whole * (v - 0.5 * a * dt * (whole - 1.0)) + rest)


@inline
def look_ahead(r: Any, qd: Array, limits: Array, dt: float) -> None:
    """Where the joints are, on the way of a robot that brakes, at `LOOKS` times."""
    last = 1.0
    for j in range(qd.shape[0]):
        last = max(last, abs(qd[j]) / r.steps[j] + 1.0)
    for i in range(LOOKS):
        for j in range(qd.shape[0]):
            way = braking_way(abs(qd[j]), limits[3, j], dt, (i + 1) * last / LOOKS)
            r.ahead[i, j] = way if qd[j] >= 0.0 else -way


@inline
def prepare(t: Any, r: Any, poses: Array, twists: Array, qd: Array, limits: Array, dt: float) -> None:
    """Ways of the joints that brake, how far each body can come until it stands, and balls."""
    n = qd.shape[0]
    for j in range(n):
        v, a = abs(qd[j]), limits[3, j]
        r.steps[j] = step = a * dt
        r.far[j], r.back[j] = braking_way(v + step, a, dt, inf), max(step - v, 0.0) * dt
    for b in range(1, n + 1):
        c = place(poses[b], t.balls[b, 0], t.balls[b, 1], t.balls[b, 2])
        r.balls[b, 0], r.balls[b, 1], r.balls[b, 2] = c
        for j in range(n):
            if t.supports[b, j] == 0.0 or t.balls[b, 3] < 0.0:
                r.ways[b, j] = 0.0
                continue
            w = (twists[3, j], twists[4, j], twists[5, j])
            v3 = add((twists[0, j], twists[1, j], twists[2, j]), 1.0, cross(w, c))
            r.ways[b, j] = r.far[j] * (sqrt(dot(v3, v3)) + sqrt(dot(w, w)) * t.balls[b, 3])
    r.balls[0, 0], r.balls[0, 1], r.balls[0, 2] = t.balls[0, 0], t.balls[0, 1], t.balls[0, 2]
    for j in range(n):
        r.ways[0, j] = 0.0
    for i in range(t.index.shape[0]):
        ball = t.shapes[i]
        x, y, z = place(poses[t.index[i, BODY]], ball[BALL], ball[BALL + 1], ball[BALL + 2])
        r.globes[i, 0], r.globes[i, 1], r.globes[i, 2] = x, y, z


@inline
def reach(t: Any, r: Any, a: int, b: int) -> float:
    """How much nearer two bodies can come until both stand [m]: joints that move both do not count."""
    way = 0.0
    for j in range(r.far.shape[0]):
        if t.supports[a, j] != t.supports[b, j]:
            way += r.ways[a, j] + r.ways[b, j]
    return way


@inline
def along_normal(
    t: Any, r: Any, twists: Array, qd: Array, a: int, b: int, c: Vector, o: Vector, size: float, n: Vector
) -> float:
    """How far points of two bodies can come nearer along n until all joints stand, at most [m].

    Args:
        t, r, twists, qd: As for `clearance_rows`.
        a, b: The bodies.
        c, o: Centres of balls around the points.
        size: The larger radius.
        n: From the first to the second.
    """
    way = 0.0
    for j in range(qd.shape[0]):
        if t.supports[a, j] == t.supports[b, j]:
            continue
        w, v = (twists[3, j], twists[4, j], twists[5, j]), (twists[0, j], twists[1, j], twists[2, j])
        across = cross(n, w)
        wide = sqrt(dot(across, across)) * size
        g = dot(n, add(v, 1.0, cross(w, c if t.supports[a, j] != 0.0 else o)))
        if (t.supports[a, j] != 0.0) == (qd[j] < 0.0):
            g = -g
        most = g + wide
        way += max(most * r.far[j], (wide - g) * r.back[j])
    return way


@inline
def passes(t: Any, r: Any, twists: Array, qd: Array, a: int, shape: int, c: Vector, size: float, margin: float) -> bool:
    """Whether a face of a known obstacle is out of reach of a ball (c, size) of body a, as it moves."""
    first, count = t.index[shape, PLANES_FROM], t.index[shape, PLANES]
    if count > FEW:
        return False
    for k in range(first, first + count):
        n = (-t.planes[k, 0], -t.planes[k, 1], -t.planes[k, 2])
        gap = t.planes[k, 3] - dot(n, c) - size - margin
        if gap > 0.0 and gap > along_normal(t, r, twists, qd, a, t.index[shape, BODY], c, c, size, n):
            return True
    return False


@inline
def bending(t: Any, twists: Array, ahead: Array, body: int, other: int, p: Vector, o: Vector, n: Vector) -> float:
    """How much nearer two points come than nᵀ J says, to second order, as joints that move one body alone turn by Δ.

    With exp(ξ_1 Δ_1) ... exp(ξ_k Δ_k) the point p of the body moves by Σ_j J_j Δ_j + Σ_{j<k} ω_j × J_k Δ_j Δ_k + ½ Σ_j
    ω_j × J_j Δ_j². That counts where a corner of the body meets a face that stays; where a face of the body meets a
    corner o, it moves the other way in the body's frame, in the opposite order. The larger of the two, not below 0.

    Args:
        t: The solids.
        twists: Of the joints.
        ahead: Δ (n,).
        body, other: The two bodies.
        p, o: Points of them.
        n: From p to o.
    """
    corner, face = 0.0, 0.0
    turn, shift = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(ahead.shape[0]):
        if t.supports[body, j] == 0.0 or t.supports[other, j] != 0.0:
            continue
        w = (twists[3, j], twists[4, j], twists[5, j])
        v = (twists[0, j], twists[1, j], twists[2, j])
        at_p, at_o = add(v, 1.0, cross(w, p)), add(v, 1.0, cross(w, o))
        x = ahead[j]
        corner += x * dot(n, cross(add(turn, 0.5 * x, w), at_p))
        face -= x * dot(n, cross(w, add(shift, 0.5 * x, at_o)))
        turn, shift = add(turn, x, w), add(shift, x, at_o)
    return max(corner, face, 0.0)
