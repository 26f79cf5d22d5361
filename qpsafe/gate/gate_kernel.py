"""The gate in one compiled call: the command, or the part of it that can be let through.

With b the command that brakes at the limits, {b + λ (u - b)} is searched for the largest λ whose way passes. λ = 0 is
verified already: its way is the rest of the last command's, and nobody's ball is larger than was reckoned with.
"""

from __future__ import annotations

from math import inf

from numba import types

from qpsafe.compiled import by_reference as reference_module
from qpsafe.compiled.by_reference import by_reference
from qpsafe.compiled.compiled import Array, entry, inline, readable
from qpsafe.compiled.memory import view
from qpsafe.gate import braking_path, people_kernel, solids_kernel, tables, workspace
from qpsafe.gate.braking_path import slow_down
from qpsafe.gate.people_kernel import LEFT, look, people_excess, stand
from qpsafe.gate.solids_kernel import touched
from qpsafe.gate.tables import CAPSULES, DT, GROUPS, PAIRS, SHAPES
from qpsafe.geometry import pairs as pairs_module
from qpsafe.robot.kinematics import Index

BISECTIONS = 5  # λ is found to 1/32
#: Instants that are looked at in a tick, at most: with limits by which it brakes for minutes the robot only brakes.
#: The bundled robots ask for 3,000 at most, at full speed in any posture with 20 people near.
LOOKS = 20_000

#: What held a command back.
NOTHING, PERSON_NEAR, SOLID_NEAR = 0, 1, 2
#: `told` of a call: the share λ; what held it back; capsule or group; point or pair; what braking is short of [m],
#: infinite where its way is too long to be looked at.
SHARE, CAUSE, WHO, POINT, SHORT = range(5)
TOLD = 5
WORTH_SAYING = 1e-3  # that braking is short of, well within the error of a seen point [m]

USES = (
    reference_module, tables, workspace, braking_path, people_kernel, solids_kernel, pairs_module,
    *people_kernel.USES, *pairs_module.USES,
)  # fmt: skip


@inline
def _passes(t, w, known, q, v, points, told):  # type: ignore[no-untyped-def]
    """Whether a command's way passes; if not, what is in its way is told."""
    group = touched(t, w, known, q, v)
    if group >= 0:
        told[CAUSE], told[WHO], told[POINT] = SOLID_NEAR, group, w.found[7]
        return False
    if points.shape[0] > 0 and people_excess(t, w, q, v, points, 0.0) > 0.0:
        told[CAUSE], told[WHO], told[POINT] = PERSON_NEAR, w.worst[0], w.worst[1]
        return False
    return True


_block, _whole = types.Array(types.float64, 1, "C", readonly=True), types.Array(types.int64, 1, "C", readonly=True)
_out = types.float64[::1]


@entry(
    types.float64(
        _block, _whole, _out, _out, types.int64[::1], _block, _block, _out,
        types.Array(types.float64, 2, "C", readonly=True), readable(1), readable(1), types.int64, _out,
    ),
    *USES,
)  # fmt: skip
def let_through(
    floats: Array, integers: Index, own: Array, work: Array, whole: Index, q: Array, qd: Array, command: Array,
    points: Array, ages: Array, leads: Array, measured: int, told: Array,
) -> float:  # fmt: skip
    """Replace the command by the part of it that can be let through; returns the share λ.

    Args:
        floats, integers: `Tables`.
        own: What was measured of solids, g rows of 1 + n; NaN to begin with.
        work, whole: `Work` for at least as many points.
        q, qd: Where the robot is commanded to be, and its commanded velocity (n,) [rad, rad/s].
        command: (n,) [rad/s], inside the box of the joint limits.
        points: Seen (p, 3) [m].
        ages: Of the readings that told of the first points (k,) [s].
        leads: Of the last e points, how long before now they were where they are (e,) [s].
        measured: Whether `hold_still` has looked at the same points from the same place, in the same memory.
        told: See above.
    """
    n, c, g = q.shape[0], integers[CAPSULES], integers[GROUPS]
    t = by_reference(tables.tables(floats, integers))
    w = by_reference(workspace.workspace(work, whole, n, c, integers[SHAPES], integers[PAIRS], points.shape[0]))
    known = view(own, 0, (g, 1 + n))
    told[SHARE], told[CAUSE], told[WHO], told[POINT], told[SHORT] = 1.0, 0.0, -1.0, -1.0, 0.0
    w.worst[LEFT] = LOOKS
    if measured == 0 and points.shape[0] > 0:
        stand(t, q, w.none, w.nowhere, w.memory)
        look(t, w, w.memory, points, ages, leads)
    slow_down(qd, t.acceleration, t.numbers[DT], w.brake)
    low, high, share = 0.0, 1.0, 1.0
    cause, who, point = 0.0, -1.0, -1.0
    for step in range(BISECTIONS + 1):
        for j in range(n):
            w.trial[j] = command[j] if step == 0 else w.brake[j] + share * (command[j] - w.brake[j])
        if _passes(t, w, known, q, w.trial, points, told):
            if step == 0:
                return 1.0
            low = share
        else:
            high = share
            if step == 0:
                cause, who, point = told[CAUSE], told[WHO], told[POINT]
        share = 0.5 * (low + high)
    verified = low > 0.0
    if not verified and points.shape[0] > 0:
        # somebody was seen where nobody could be: what comes nearer by less, braking or the command?
        for option in range(2):
            for j in range(n):
                w.trial[j] = w.brake[j] if option == 0 else command[j]
            excess = people_excess(t, w, q, w.trial, points, inf)
            if option == 0:
                told[SHORT] = excess
            elif excess < told[SHORT] and touched(t, w, known, q, command) < 0:
                low = 1.0
            if not excess > 0.0:
                break
    if not verified and w.worst[LEFT] < 0:
        low, told[SHORT] = 0.0, inf
    for j in range(n):
        command[j] = command[j] if low == 1.0 else w.brake[j] + low * (command[j] - w.brake[j])
    told[SHARE], told[CAUSE], told[WHO], told[POINT] = low, cause, who, point
    return low
