"""Whether a command, and the braking after it, approaches somebody whom the robot could touch; compiled.

Along the way no capsule's axis may come nearer to a seen point p than by v_s dt in a tick where its surface is within
the ball R(t) around p. Three facts spare most ticks from being looked at:

- A point of the axis of capsule c goes no faster than V = Σ_j L_cj |q̇_j|, and all speeds fall. So with the gap
  g = D - r - R(t) > 0 nothing can be inside for a time g / (v_h + V), and with V <= v_s all is well for good.
- D is the distance of p, as seen from the body, to a segment that stands still there: a convex function of a point that
  moves. So the speed of approach s = -dD/dt grows no faster than that point's acceleration, however the nearest point
  of the axis wanders. With ρ_j = L_cj + D its distance from the axis of joint j at most, W = Σ_j |q̇_j|,

      ds/dt <= B = Σ_j a_j ρ_j + 3 W Σ_j |q̇_j| ρ_j

  (of ω_j × (p - o_j): from q̈_j; from turning axes, W |q̇_j| ρ_j; from moving ones, together W Σ |q̇_j| ρ_j; from the
  body's own turning, again W Σ |q̇_j| ρ_j). So s stays below v_s for a time (v_s - s) / B.
- What is farther away than R(T) and all that the link still moves needs no look at all.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from qpsafe.compiled.compiled import Array, inline, linked
from qpsafe.compiled.memory import view
from qpsafe.gate.braking_path import at_time, braked, covered, ticks_of
from qpsafe.gate.tables import APPROACH, DT, NEAR, PERSON
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut, forward, place

_forward = linked(forward, kinematics)
_ROUNDING = 1e-11  # [m]


@inline
def stand(t: Any, q: Array, none: Index, nowhere: Array, memory: Array) -> None:
    """Kinematics of the bodies at q."""
    _forward(q, t.parents, t.placements, t.axes, t.supports, none, nowhere, memory)


@inline
def place_axes(t: Any, memory: Array, axes: Array) -> None:
    """Ends of the capsules' axes in the world (c, 2, 3)."""
    bodies = cut(memory, t.parents.shape[0], 0)[0]
    for c in range(t.radii.shape[0]):
        T = bodies[t.bodies[c]]
        for side in range(2):
            axes[c, side, 0], axes[c, side, 1], axes[c, side, 2] = place(
                T, t.ends[c, side, 0], t.ends[c, side, 1], t.ends[c, side, 2]
            )


@inline
def to_axis(axis: Array, p: Array) -> tuple[float, float]:
    """Distance of a point from a segment (2, 3), and where on it the nearest point is, 0 to 1."""
    dx, dy, dz = axis[1, 0] - axis[0, 0], axis[1, 1] - axis[0, 1], axis[1, 2] - axis[0, 2]
    x, y, z = p[0] - axis[0, 0], p[1] - axis[0, 1], p[2] - axis[0, 2]
    dd = dx * dx + dy * dy + dz * dz
    s = min(max((x * dx + y * dy + z * dz) / dd, 0.0), 1.0) if dd > 0.0 else 0.0
    x, y, z = x - s * dx, y - s * dy, z - s * dz
    return sqrt(x * x + y * y + z * z), s


@inline
def measure_all(axes: Array, points: Array, away: Array) -> None:
    """Distances of all capsules' axes from all points, one capsule after the other (c p,)."""
    for c in range(axes.shape[0]):
        for k in range(points.shape[0]):
            away[c * points.shape[0] + k], _ = to_axis(axes[c], points[k])


@inline
def _approach(t: Any, c: int, memory: Array, axis: Array, s: float, p: Array, distance: float, speeds: Array) -> float:
    """Speed at which the nearest point of an axis comes nearer to p [m/s]."""
    twists, on = cut(memory, speeds.shape[0], 0)[1], t.supports[t.bodies[c]]
    x = axis[0, 0] + s * (axis[1, 0] - axis[0, 0])
    y = axis[0, 1] + s * (axis[1, 1] - axis[0, 1])
    z = axis[0, 2] + s * (axis[1, 2] - axis[0, 2])
    nx, ny, nz = (p[0] - x) / distance, (p[1] - y) / distance, (p[2] - z) / distance
    speed = 0.0
    for j in range(speeds.shape[0]):
        # nᵀ (v + ω × x)
        along = nx * (twists[0, j] + twists[4, j] * z - twists[5, j] * y)
        along += ny * (twists[1, j] + twists[5, j] * x - twists[3, j] * z)
        along += nz * (twists[2, j] + twists[3, j] * y - twists[4, j] * x)
        speed += on[j] * along * speeds[j]
    return speed


@inline
def _hot(t: Any, v: Array, points: int, age: float, away: Array, hot: Index) -> int:
    """Pairs that have to be looked at along the way of a command, into `hot`; returns how many."""
    n, dt, count = v.shape[0], t.numbers[DT], 0
    for c in range(t.radii.shape[0]):
        sweep, ticks = 0.0, 0
        for j in range(n):
            if t.levers[c, j] > 0.0:
                ticks = max(ticks, ticks_of(v[j], t.acceleration[j], dt))
                sweep += t.levers[c, j] * abs(covered(v[j], t.acceleration[j], dt, 1e9))
        if sweep == 0.0:
            continue
        reach = t.radii[c] + t.numbers[NEAR] + t.numbers[PERSON] * (age + ticks * dt) + sweep
        for k in range(points):
            if not away[c * points + k] > reach:
                hot[count] = c * points + k
                count += 1
    return count


@inline
def people_excess(t: Any, w: Any, q: Array, v: Array, points: Array, age: float, to_the_end: bool) -> float:
    """By how much a command's way approaches people too fast: sum over ticks and pairs of what is above v_s dt [m].

    Args:
        t: `Tables`.
        w: `Work`, with `away` of the configuration q, and `memory` and `axes` to work in.
        q: Where the robot is (n,) [rad].
        v: The command (n,) [rad/s].
        points: Seen (p, 3) [m].
        age: Of what was seen [s].
        to_the_end: Whether all of it is summed up; else the first excess is returned.

    The first capsule and point concerned are left in `w.worst`.
    """
    n, p, dt, v_s = q.shape[0], points.shape[0], t.numbers[DT], t.numbers[APPROACH]
    count = _hot(t, v, p, age, w.away, w.hot)
    excess, tick, stepped = 0.0, 0, 0
    while count > 0:
        time = tick * dt
        at_time(q, v, t.acceleration, dt, time, w.there)
        total = 0.0
        for j in range(n):
            w.speeds[j] = braked(v[j], t.acceleration[j], dt, float(tick))
            total += abs(w.speeds[j])
        stand(t, w.there, w.none, w.nowhere, w.memory)
        place_axes(t, w.memory, w.axes)
        radius = t.numbers[NEAR] + t.numbers[PERSON] * (age + time)
        left, ahead = 0, 1 << 30
        for h in range(count):
            pair = w.hot[h]
            c, k = pair // p, pair % p
            distance, s = to_axis(w.axes[c], points[k])
            inside = not min(distance, w.before[pair]) - t.radii[c] >= radius
            if stepped == 1 and inside and w.before[pair] - distance > v_s * dt + _ROUNDING:
                if excess == 0.0:
                    w.worst[0], w.worst[1] = c, k
                excess += w.before[pair] - distance - v_s * dt
                if not to_the_end:
                    return excess
            w.before[pair] = distance
            fastest, growth = 0.0, 0.0
            for j in range(n):
                lever = t.levers[c, j]
                if lever > 0.0:
                    fastest += lever * abs(w.speeds[j])
                    growth += (lever + distance) * (t.acceleration[j] + 3.0 * total * abs(w.speeds[j]))
            if fastest <= v_s:
                continue  # so it is for the rest of the way
            gap = distance - t.radii[c] - radius
            if gap > 0.0:
                steps = gap / ((t.numbers[PERSON] + fastest) * dt)
            elif distance > 0.0:
                towards = _approach(t, c, w.memory, w.axes[c], s, points[k], distance, w.speeds)
                steps = (v_s - towards) / (growth * dt)
            else:
                steps = 0.0
            ahead = min(ahead, int(max(min(steps, 1e6), 1.0)))
            w.hot[left] = pair
            left += 1
        count, tick, stepped = left, tick + ahead, ahead
    return excess
