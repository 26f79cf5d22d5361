"""Joints that stand before a link that cannot get away is touched, compiled.

Whoever reaches for the turntable or for the foot of the lower arm cannot be evaded: whatever the joints do, the link
turns on the spot, and all that is left to choose is whether it moves when it is touched. So each joint j that moves
such a link must be able to stand by then. With d the distance of the surface from the
seen point, and w its speed of approach,

    τ = (d - R(0))/(v_h + w) - age,    |q̇_j| <= a_j τ,

R(0) and v_h those of the gate. As long as w does not rise, and the link could not get away before either, d falls no
faster than v_h + w, and a_j τ no faster than joint j can brake. Where somebody is first seen near, or a link becomes
such a one near somebody, joints brake as hard as they can: no bound is below |q̇_j| - a_j dt. A link cannot get away
if, starting from rest, it is after 0.1 s slower than the speed `escape`:

    Σ_j |nᵀ J_j| min(v_j, a_j 0.1 s) < escape,    n from the seen point to the nearest point of the capsule's axis.

The bound is one more limit of the tick's box, so the law uses the other joints, and a task that needs these waits.
"""

from __future__ import annotations

from math import inf

from numba import types

from qpsafe.compiled import by_reference as reference_module
from qpsafe.compiled.by_reference import by_reference
from qpsafe.compiled.compiled import Array, entry, inline, readable, row
from qpsafe.gate import braking_path, people_kernel, tables, workspace
from qpsafe.gate.people_kernel import look, to_axis
from qpsafe.gate.tables import CAPSULES, DT, ESCAPE, NEAR, PAIRS, PERSON, SHAPES
from qpsafe.geometry import pairs
from qpsafe.robot.kinematics import Index, cut

#: All the code that goes into the kernel.
USES = (
    reference_module, tables, workspace, braking_path, people_kernel, *people_kernel.USES, pairs, *pairs.USES,
)  # fmt: skip
_block, _whole = types.Array(types.float64, 1, "C", readonly=True), types.Array(types.int64, 1, "C", readonly=True)
_out = types.float64[::1]


@inline
def _away(t, w, memory, c, p, qd):  # type: ignore[no-untyped-def]
    """How fast a capsule could be going away from a point after a moment, and how fast it approaches it now [m/s]."""
    axis, twists, on = w.axes[c], cut(memory, qd.shape[0], 0)[1], t.supports[t.bodies[c]]
    distance, s = to_axis(axis, p)
    if not distance > 0.0:
        return 0.0, 0.0
    x = axis[0, 0] + s * (axis[1, 0] - axis[0, 0])
    y = axis[0, 1] + s * (axis[1, 1] - axis[0, 1])
    z = axis[0, 2] + s * (axis[1, 2] - axis[0, 2])
    nx, ny, nz = (x - p[0]) / distance, (y - p[1]) / distance, (z - p[2]) / distance
    most, now = 0.0, 0.0
    for j in range(qd.shape[0]):
        if on[j] != 0.0:
            v, o = twists[:3, j], twists[3:, j]
            vx, vy, vz = v[0] + o[1] * z - o[2] * y, v[1] + o[2] * x - o[0] * z, v[2] + o[0] * y - o[1] * x
            rate = nx * vx + ny * vy + nz * vz
            most += abs(rate) * t.swift[j]
            now -= rate * qd[j]
    return most, now


@entry(
    types.int64(
        _block, _whole, _out, types.int64[::1], _block, _block,
        types.Array(types.float64, 2, "C", readonly=True), readable(1), readable(1), _out,
    ),
    *USES,
)  # fmt: skip
def hold_still(
    floats: Array, integers: Index, work: Array, whole: Index, memory: Array, qd: Array, points: Array, ages: Array,
    leads: Array, most: Array,
) -> int:  # fmt: skip
    """Fill `most` (n,) with the joints' largest speeds, infinite where nothing holds them; returns how many are held.

    Args:
        floats, integers: `Tables`.
        work, whole: `Work` for at least as many points; what was measured in it stays, for `let_through`.
        memory: Of `kinematics.forward`, where the robot is commanded to be.
        qd: Its commanded velocity (n,) [rad/s].
        points, ages, leads: As for `let_through`.
        most: [rad/s].
    """
    n, c, held = qd.shape[0], integers[CAPSULES], 0
    t = by_reference(tables.tables(floats, integers))
    w = by_reference(workspace.workspace(work, whole, n, c, integers[SHAPES], integers[PAIRS], points.shape[0]))
    look(t, w, memory, points, ages, leads)
    longest, dt = 0.0, t.numbers[DT]  # what takes longer to come cannot hold any joint yet
    for j in range(n):
        most[j] = inf
        longest = max(longest, abs(qd[j]) / t.acceleration[j] + dt)
    for a in range(c if t.numbers[ESCAPE] > 0.0 else 0):
        fastest = t.numbers[PERSON]
        for j in range(n):
            fastest += t.levers[a, j] * abs(qd[j])
        for k in range(points.shape[0]):
            room = w.away[a * points.shape[0] + k] - t.radii[a] - t.numbers[NEAR]
            if room > fastest * (longest + w.ages[k]):
                continue
            escape, now = _away(t, w, memory, a, row(points, k), qd)
            if escape >= t.numbers[ESCAPE]:
                continue
            speed = t.numbers[PERSON] + max(now, 0.0)
            left = (room / speed if speed > 0.0 else (inf if room > 0.0 else 0.0)) - w.ages[k]
            for j in range(n):
                if t.supports[t.bodies[a], j] != 0.0:
                    most[j] = min(most[j], t.acceleration[j] * max(left, 0.0))
    for j in range(n):
        if most[j] < abs(qd[j]) + t.acceleration[j] * dt:
            most[j], held = max(most[j], abs(qd[j]) - t.acceleration[j] * dt), held + 1
        else:
            most[j] = inf
    return held
