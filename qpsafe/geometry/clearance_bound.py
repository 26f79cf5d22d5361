"""How fast two points may come nearer, compiled: the bound of a clearance row.

A point pair at the distance d with the normal n and the row g = nᵀ (J_a - J_b) comes nearer by g·q̇. Its row is
g·q̇ <= the lower of two bounds, with s = d - margin. The first is that of a joint and its position limit,

    (1)  stopping_speed(s) at the deceleration Σ_j |g_j| a_j,

which the joints have together if all go against the row, less what `bending` takes of it. The second looks at the
robot braking, each joint at its own limit: after the time t joint j has covered φ_j(t), the `braking_way` from its
velocity now, and the pair has come nearer by w = max_t Σ_j g_j φ_j(t) + `bending`. In one tick joint j can add |g_j|
a_j dt at most to the speed of approach, and what it adds leads farther by T_j times that until it stands again,

    T_j = dt max(|u_j / (a_j dt) + 1/2| + 1/2, 1),     u_j = q̇_j in the direction in which j approaches,

the exact chord of φ_j over that change. Whichever joints add it, a speed of approach that is higher by δ leads farther
by W(δ) at most: those with the largest T_j first, each as much as it can. So

    (2)  g·q̇_now + W⁻¹(s - w),

which nothing breaks where s - w >= W of all that can be added; below 0 it is (s - w) / T, T the mean of the T_j as the
joints can add. Both bounds are continuous in position, velocity and distance: no rounding decides between two of them.
"""

from __future__ import annotations

from math import inf
from typing import Any

from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, inline
from qpsafe.geometry.reach import LOOKS, bending
from qpsafe.limits import stopping_speed

RETURN_SPEED = 0.05  # of what is nearer than the margin, away from there [m/s]


@inline
def highest(s: float, push: float, dt: float) -> float:
    """Highest speed of approach at the distance s from the margin, of which push can be taken each tick [m/s]."""
    if s >= 0.0:
        return stopping_speed(s, push / dt, dt) if push > 0.0 else inf
    return -min(-s / dt, RETURN_SPEED)


@inline
def added(r: Any, qd: Array, push: float, room: float, dt: float) -> float:
    """W⁻¹ of a way: what the row's speed may be higher by in the next tick [m/s]."""
    whole = 0.0
    for j in range(qd.shape[0]):
        approach = qd[j] if r.g[j] >= 0.0 else -qd[j]
        r.times[j] = dt * max(abs(approach / r.steps[j] + 0.5) + 0.5, 1.0)
        whole += abs(r.g[j]) * r.steps[j] * r.times[j]
    if not (whole > 0.0 and room < whole):  # joints that do not count, or that stop at once, too
        return inf
    if room <= 0.0:
        return room * push / whole
    speed = 0.0
    for _ in range(qd.shape[0]):  # the longest that is left
        at = 0
        for j in range(1, qd.shape[0]):
            if r.times[j] > r.times[at]:
                at = j
        most = abs(r.g[at]) * r.steps[at]
        if most * r.times[at] >= room:
            return speed + room / r.times[at]
        speed += most
        room -= most * r.times[at]
        r.times[at] = 0.0
    return speed


@inline
def bound_of(
    t: Any, r: Any, twists: Array, qd: Array, a: int, b: int, p: Vector, o: Vector, n: Vector, s: float, dt: float
) -> tuple[float, float]:
    """Fill g = nᵀ (J_a(p) - J_b(o)); its upper bound, and how much of it the next tick leaves at worst [m/s].

    What is left is positive, and no row is needed, too, where the way at full acceleration and then braking is no more
    than s with all that goes the other way left out.
    """
    speed, push, most = 0.0, 0.0, 0.0
    for j in range(qd.shape[0]):
        w, v = (twists[3, j], twists[4, j], twists[5, j]), (twists[0, j], twists[1, j], twists[2, j])
        g = t.supports[a, j] * dot(n, add(v, 1.0, cross(w, p))) - t.supports[b, j] * dot(n, add(v, 1.0, cross(w, o)))
        r.g[j] = g
        speed += g * qd[j]
        push += abs(g) * r.steps[j]
        most += abs(g) * (r.far[j] if g * qd[j] >= 0.0 else r.back[j])
    if most <= s:
        return inf, inf
    way, back = -inf, (-n[0], -n[1], -n[2])
    for i in range(LOOKS):
        covered = 0.0
        for j in range(qd.shape[0]):
            covered += r.g[j] * r.ahead[i, j]
        covered += bending(t, twists, r.ahead[i], a, b, p, o, n) + bending(t, twists, r.ahead[i], b, a, o, p, back)
        way = max(way, covered)
    # what bends towards the other takes of the deceleration
    bent = 2.0 * dt * (bending(t, twists, qd, a, b, p, o, n) + bending(t, twists, qd, b, a, o, p, back))
    bound = min(highest(s, max(push - bent, 0.2 * push), dt), speed + added(r, qd, push, s - way, dt))
    return max(bound, -RETURN_SPEED), bound - speed - push
