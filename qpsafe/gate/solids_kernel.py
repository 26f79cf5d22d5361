"""Whether a command, and the braking after it, keeps clear of furniture, floor and the robot itself; compiled.

Pairs of shapes are in groups: those of one body against what stands, those of two bodies. No point of a group comes
nearer to its counterpart faster than V = Σ_j L_gj |q̇_j|. So a distance d measured once, at a configuration q*, holds
good as long as  Σ_j L_gj |q_j - q*_j| < d - margin  all along the way: that is the usual tick, without any measuring.
Else the distance is measured again, and if that is not enough, at instants along the way: from one with the distance d
on to the next one after (d - margin) / V, or at the end of the tick, or after d / V, where it has to be at least the
margin again. So it is at the end of every tick, whatever is sent then; and between two instants a and b it is never
below (d_a + d_b - V h)/2 >= d_b/2, half the margin.

What is nearer than the margin already may not come any nearer.
"""

from __future__ import annotations

from math import floor, nan
from typing import Any

from qpsafe.compiled.compiled import Array, inline, linked
from qpsafe.compiled.memory import view
from qpsafe.gate.braking_path import at_time, braked, covered
from qpsafe.gate.people_kernel import may_look, stand
from qpsafe.gate.tables import DT, FARTHEST, MARGIN
from qpsafe.geometry import pairs as pairs_module
from qpsafe.geometry.pairs import nearest_pair
from qpsafe.robot.kinematics import cut

_nearest_pair = linked(nearest_pair, *pairs_module.USES)
_ROUNDING = 1e-9  # [m]


@inline
def _distance(t: Any, w: Any, group: int, q: Array, farthest: float) -> float:
    """Smallest distance of the pairs of a group at q, not above `farthest`."""
    stand(t, q, w.none, w.nowhere, w.memory)
    first = t.group_starts[group]
    found = _nearest_pair(
        cut(w.memory, q.shape[0], 0)[0], view(t.pairs, 2 * first, (t.group_starts[group + 1] - first, 2)),
        t.index, t.shapes, t.vertices, t.starts, t.neighbours, t.planes, farthest, w.pair, w.found,
    )  # fmt: skip
    w.found[7] = first + found
    return min(w.found[0], farthest) if w.found[0] == w.found[0] else nan


@inline
def touched(t: Any, w: Any, known: Array, q: Array, v: Array) -> int:
    """The first group that a command's way comes too near to; -1 for none.

    Args:
        t: `Tables`.
        w: `Work`.
        known: Of each group the distance that was measured last, and where (g, 1 + n).
        q: Where the robot is (n,) [rad].
        v: The command (n,) [rad/s].
    """
    n, dt, margin = q.shape[0], t.numbers[DT], t.numbers[MARGIN]
    for j in range(n):
        w.end[j] = q[j] + covered(v[j], t.acceleration[j], dt, 1e9)
    for g in range(known.shape[0]):
        way = 0.0
        for j in range(n):
            way += t.group_levers[g, j] * max(abs(q[j] - known[g, 1 + j]), abs(w.end[j] - known[g, 1 + j]))
        if way < known[g, 0] - margin:
            continue
        here, way = True, 0.0
        for j in range(n):
            here = here and known[g, 1 + j] == q[j]
            way += t.group_levers[g, j] * abs(w.end[j] - q[j])
        if way == 0.0:
            continue
        if not here:
            known[g, 0] = _distance(t, w, g, q, t.numbers[FARTHEST])
            for j in range(n):
                known[g, 1 + j] = q[j]
        d, time = known[g, 0], 0.0
        least = min(margin, d) - _ROUNDING
        while not way < d - least:
            if not may_look(w):
                return g  # too long a way for one tick
            fastest, tick = 0.0, time // dt
            for j in range(n):
                fastest += t.group_levers[g, j] * abs(braked(v[j], t.acceleration[j], dt, tick))
            # where the distance cannot fall below what is asked for; else not beyond the end of the tick
            rest = (floor(time / dt + 1e-6) + 1.0) * dt - time
            time += max((d - least) / fastest, min(max(d, 0.5 * margin) / fastest, rest))
            at_time(q, v, t.acceleration, dt, time, w.there)
            way = 0.0
            for j in range(n):
                way += t.group_levers[g, j] * abs(w.end[j] - w.there[j])
            d = _distance(t, w, g, w.there, way + 2.0 * margin)
            if not d >= least:
                return g
            if way == 0.0:
                break
    return -1
