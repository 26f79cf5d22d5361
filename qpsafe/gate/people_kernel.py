"""Whether a command, and the braking after it, approaches somebody whom the robot could touch; compiled.

A person seen at p moves no faster than v_h. After a time t on the way, p is at any p' with |p' - p| <= u = v_h t, t
no longer than the time `sidestep`, and a link whose surface is nearer to p than R(t) could touch somebody: it must not
approach any such p' faster than v_s.
With n from the nearest point of the capsule's axis to p, D its distance, (v, ω) the body's twist and B = v + ω × p the
body's velocity field at p, the speed of approach to p' is n'ᵀ (v + ω × p'), where n' differs from n by an angle of
θ at most, sin θ = u/D, since p - nearest(p) moves no farther than p does. So it is at most

    S(u) = max_{∠(n', n) <= θ} n'ᵀ B + |ω| u,    and at most V = Σ_j L_cj |q̇_j|, the speed of any point of the axis.

Seen from the body the axis stands still, and the distance is a convex function of a point that moves: so the speed of
approach grows no faster than that point's acceleration, however the nearest point wanders. With ρ_j = L_cj + D + u its
distance from the axis of joint j at most, W = Σ_j |q̇_j|,

    dS/dt <= Σ_j a_j ρ_j + C,   C = 3 W Σ_j |q̇_j| ρ_j

(of ω_j × (p - o_j): from q̈_j; from turning axes, W |q̇_j| ρ_j; from moving ones, together W Σ |q̇_j| ρ_j; from the
body's own turning, again W Σ |q̇_j| ρ_j). Within a tick joints do not accelerate. A tick passes if S(u(t + dt)) + C dt
<= v_s; m ticks at once if S(u(t + m dt)) + (Σ_j a_j ρ_j + C) m dt <= v_s, which implies it of each of them. So what is
told does not depend on which ticks are looked at; and if a way passes, the rest of it passes a tick later, for any
p' that p may have moved to, if `sidestep` is infinite: its conditions are then among those that held before.
"""

from __future__ import annotations

from typing import Any

from qpsafe.compiled import gather as gather_module
from qpsafe.compiled import lanes
from qpsafe.compiled.compiled import Array, Vector, inline, linked, row
from qpsafe.compiled.gather import gather, put
from qpsafe.compiled.lanes import LANES, sqrt, where
from qpsafe.gate.braking_path import at_time, braked, covered, ticks_of
from qpsafe.gate.tables import APPROACH, DT, MAX_AGE, NEAR, PERSON, SIDESTEP
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut, forward, place

_forward = linked(forward, kinematics)
#: All the code that goes into kernels with this.
USES = (lanes, gather_module, kinematics)
_ROUNDING = 1e-9  # [m/s]
MOST = 16  # ticks that are looked at together, a power of 2
LEFT = 2  # place in `Work.worst` of how many instants may still be looked at in this tick


@inline
def stand(t: Any, q: Array, none: Index, nowhere: Array, memory: Array) -> None:
    """Kinematics of the bodies at q."""
    _forward(q, t.parents, t.placements, t.axes, t.supports, none, nowhere, memory)


@inline
def may_look(w: Any) -> bool:
    """Whether one more instant of a way may be looked at in this tick."""
    w.worst[LEFT] -= 1
    return bool(w.worst[LEFT] >= 0)


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
def to_axis(axis: Array, p: Vector) -> tuple[float, float]:
    """Distance of a point from a segment (2, 3), and where on it the nearest one is, 0 to 1; of one point, or lanes."""
    dx, dy, dz = axis[1, 0] - axis[0, 0], axis[1, 1] - axis[0, 1], axis[1, 2] - axis[0, 2]
    x, y, z = p[0] - axis[0, 0], p[1] - axis[0, 1], p[2] - axis[0, 2]
    dd = dx * dx + dy * dy + dz * dz
    s = where(dd > 0.0, (x * dx + y * dy + z * dz) / dd, 0.0)
    s = where(s > 0.0, where(s < 1.0, s, 1.0), 0.0 * s)  # NaN stays
    x, y, z = x - s * dx, y - s * dy, z - s * dz
    return sqrt(x * x + y * y + z * z), s


@inline
def measure_all(axes: Array, points: Array, away: Array) -> None:
    """Distances of all capsules' axes from all points, one capsule after the other (c p,)."""
    count = points.shape[0]
    for first in range(0, count, LANES):
        p = gather(points, first, 0), gather(points, first, 1), gather(points, first, 2)
        for c in range(axes.shape[0]):
            distance, _ = to_axis(axes[c], p)
            put(distance, away, c * count + first, count - first)


@inline
def _oldest(ages: Array, most: float) -> float:
    """The largest age of a reading that counts; those of clocks that go wrong are 0."""
    oldest = 0.0
    for k in range(ages.shape[0]):
        if oldest < ages[k] <= most:
            oldest = ages[k]
    return oldest


@inline
def look(t: Any, w: Any, memory: Array, points: Array, ages: Array, leads: Array) -> None:
    """Ages of all points, and their distances from all axes, whose bodies stand in `memory`; nothing without points."""
    if points.shape[0] == 0:
        return
    oldest, first = _oldest(ages, t.numbers[MAX_AGE]), points.shape[0] - leads.shape[0]
    for k in range(points.shape[0]):
        w.ages[k] = oldest if k < first else leads[k - first]
    place_axes(t, memory, w.axes)
    measure_all(w.axes, points, w.away)


@inline
def _field(t: Any, c: int, memory: Array, speeds: Array, axis: Array, s: float, p: Array) -> tuple[float, float, float]:
    """Of the body's velocity field at p: along n (times the distance), its square, and |ω|."""
    twists, on = cut(memory, speeds.shape[0], 0)[1], t.supports[t.bodies[c]]
    vx, vy, vz, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(speeds.shape[0]):
        rate = on[j] * speeds[j]
        vx, vy, vz = vx + rate * twists[0, j], vy + rate * twists[1, j], vz + rate * twists[2, j]
        wx, wy, wz = wx + rate * twists[3, j], wy + rate * twists[4, j], wz + rate * twists[5, j]
    bx, by, bz = vx + wy * p[2] - wz * p[1], vy + wz * p[0] - wx * p[2], vz + wx * p[1] - wy * p[0]
    nx = p[0] - axis[0, 0] - s * (axis[1, 0] - axis[0, 0])
    ny = p[1] - axis[0, 1] - s * (axis[1, 1] - axis[0, 1])
    nz = p[2] - axis[0, 2] - s * (axis[1, 2] - axis[0, 2])
    return nx * bx + ny * by + nz * bz, bx * bx + by * by + bz * bz, sqrt(wx * wx + wy * wy + wz * wz)


@inline
def _largest(along: float, b: float, turning: float, distance: float, u: float) -> float:
    """S(u): the fastest approach to any p' within u of p."""
    if not u < distance:
        return b + turning * u
    sine = u / distance
    cosine = sqrt(1.0 - sine * sine)
    if along >= b * cosine:
        return b + turning * u
    return along * cosine + sqrt(max(b * b - along * along, 0.0)) * sine + turning * u


@inline
def _hot(t: Any, w: Any, v: Array) -> int:
    """Pairs that have to be looked at along the way of a command, into `w.hot`; returns how many."""
    n, points, dt, count, ages, away, hot = v.shape[0], w.ages.shape[0], t.numbers[DT], 0, w.ages, w.away, w.hot
    ways, times = w.there, w.speeds  # of the joints until they stand
    for j in range(n):
        ways[j], times[j] = abs(covered(v[j], t.acceleration[j], dt, 1e9)), ticks_of(v[j], t.acceleration[j], dt)
    for c in range(t.radii.shape[0]):
        sweep, ticks = 0.0, 0.0
        for j in range(n):
            if t.levers[c, j] > 0.0:
                ticks = max(ticks, times[j])
                sweep += t.levers[c, j] * ways[j]
        if sweep == 0.0:
            continue
        reach = t.radii[c] + t.numbers[NEAR] + t.numbers[PERSON] * ticks * dt + sweep
        for k in range(points):
            if not away[c * points + k] > reach + t.numbers[PERSON] * ages[k]:
                hot[count] = c * points + k
                count += 1
    return count


@inline
def people_excess(t: Any, w: Any, q: Array, v: Array, points: Array, enough: float) -> float:
    """By how much a command's way approaches people too fast: sum over ticks and pairs of what is above v_s, times dt.

    Args:
        t: `Tables`.
        w: `Work`, with `away` of the configuration q, `ages` of the points, and `memory` and `axes` to work in.
        q: Where the robot is (n,) [rad].
        v: The command (n,) [rad/s].
        points: Seen (p, 3) [m].
        enough: Excess at which it is returned [m]; infinite to sum up all of it.

    The first capsule and point concerned are left in `w.worst`.
    """
    n, p, dt, v_s = q.shape[0], points.shape[0], t.numbers[DT], t.numbers[APPROACH]
    count = _hot(t, w, v)
    excess, tick, person = 0.0, 0, t.numbers[PERSON]
    while count > 0:
        if not may_look(w):
            return excess + dt  # too long a way for one tick
        time = tick * dt
        at_time(q, v, t.acceleration, dt, time, w.there)
        total = 0.0
        for j in range(n):
            w.speeds[j] = braked(v[j], t.acceleration[j], dt, float(tick))
            total += abs(w.speeds[j])
        stand(t, w.there, w.none, w.nowhere, w.memory)
        place_axes(t, w.memory, w.axes)
        radius = t.numbers[NEAR] + person * (time + dt)  # at the end of the tick, of what was seen now
        left, ahead = 0, MOST
        for h in range(count):
            pair = w.hot[h]
            c, k = pair // p, pair % p
            fastest = 0.0
            for j in range(n):
                fastest += t.levers[c, j] * abs(w.speeds[j])
            if fastest <= v_s:
                continue  # so it is for the rest of the way
            w.hot[left] = pair
            left += 1
            distance, s = to_axis(w.axes[c], row(points, k))
            gap = distance - t.radii[c] - radius - person * w.ages[k] - fastest * dt
            if gap >= 0.0:
                ahead = min(ahead, 1 + int(min(gap / ((person + fastest) * dt), 1e6)))
                continue
            along, square, turning = _field(t, c, w.memory, w.speeds, w.axes[c], s, points[k])
            b, steps = sqrt(square), MOST
            along = along / distance if distance > 0.0 else b
            while True:
                u, growth = person * min(time + steps * dt, t.numbers[SIDESTEP]), 0.0
                for j in range(n):
                    speed = abs(w.speeds[j])
                    if t.levers[c, j] > 0.0:
                        more = t.acceleration[j] if steps > 1 else 0.0
                        growth += (t.levers[c, j] + distance + u) * (more + 3.0 * total * speed)
                over = min(_largest(along, b, turning, distance, u), fastest) + growth * steps * dt - v_s
                if over <= 0.0 or steps == 1:
                    break
                steps //= 2
            if over > _ROUNDING:
                if excess == 0.0:
                    w.worst[0], w.worst[1] = c, k
                excess += over * dt
                if excess > enough:
                    return excess
            ahead = min(ahead, steps)
        count, tick = left, tick + ahead
    return excess
