"""What looks at a robot now and then: `StallWatch` and `UnitWatch` for tasks whose numbers are known."""

from __future__ import annotations

from typing import Any

from qpsafe.batch import code
from qpsafe.batch.recovery_kernel import copy, lead
from qpsafe.batch.reference_kernel import error_norm, measure, sample_all
from qpsafe.compiled.compiled import Array, inline
from qpsafe.recovery import stall
from qpsafe.recovery.stall import CALM, HELD, MOVING, STALLED
from qpsafe.sensing.units import LOOKS, all_far, count_far
from qpsafe.tasks.offset import offset_into

_judge = inline(stall.judge)


@inline
def _clear(s: Any) -> None:
    for k in range(5):
        s.stall[k] = 0
    s.marks[code.COMPARED_VALUES] = 0
    for a in range(3):
        for k in range(s.amounts.shape[1]):
            s.amounts[a, k] = 0.0


@inline
def _same_references(p: Any, s: Any, w: Any) -> bool:
    """Whether references stand still: as far from the values of the last look as then."""
    same = s.marks[code.COMPARED_VALUES] == 1
    for k in range(p.gains.shape[0]):
        offset_into(s.values[k], w.goals[p.paths[k]], w.shift)
        for c in range(6):
            same = same and w.shift[c] == s.compared[k, c]
    return same


@inline
def watch_stall(p: Any, s: Any, w: Any, explained: bool) -> None:
    """See `StallWatch.watch`; `poses` has the tasks' frames."""
    if s.marks[code.SEQ] % p.whole[code.EVERY] != 0 and s.stall[HELD] == 0:
        return
    explained = explained or s.marks[code.WAY] == 1
    if explained and s.stall[HELD] == 1:
        _clear(s)
    if s.marks[code.SEQ] % p.whole[code.EVERY] != 0:
        return
    tasks = p.gains.shape[0]
    sample_all(p, w, s.clock[code.TIME])
    measure(p, w)
    anybody = False
    for k in range(tasks):
        w.switches[k] = error_norm(p, w.offsets[k], k)
        w.last[k] = 1 if p.essential[k] == 1 and not w.switches[k] <= p.numbers[code.TOLERANCE] else 0
        anybody = anybody or w.last[k] == 1
    if not anybody:
        copy(s.q, s.met)
        s.marks[code.MET_KNOWN] = 1
    if explained:
        _clear(s)
        return
    still = _same_references(p, s, w)
    for k in range(tasks):
        for a in range(4):
            copy(w.poses[k, a], s.values[k, a])
        copy(w.offsets[k], s.compared[k])
    s.marks[code.COMPARED_VALUES] = 1
    speed, evasive = 0.0, 0.0
    for j in range(s.qd.shape[0]):
        speed, evasive = max(speed, abs(s.qd[j])), max(evasive, abs(s.qd0[j]))
    _judge(
        w.switches, w.last[:tasks], p.essential, still, evasive < CALM and speed > MOVING,
        (p.whole[code.PATIENCE], p.numbers[code.FAR]), s.amounts, s.stall,
    )  # fmt: skip
    if s.stall[STALLED] == 1 and s.marks[code.MET_KNOWN] == 1 and lead(p, s):
        _clear(s)


@inline
def watch_units(p: Any, s: Any, noticed: Array, distances: Array, points: Array, by_points: bool) -> None:
    """See `UnitWatch`."""
    s.marks[code.UNIT_TICKS] += 1
    if s.marks[code.UNIT_TICKS] % p.whole[code.UNITS_EVERY] != 0:
        return
    if not by_points:
        if count_far(distances, p.farthest, s.far, noticed):
            s.marks[code.ODD] |= 1
    elif points.shape[0] > 0:
        s.marks[code.FAR_POINTS] = s.marks[code.FAR_POINTS] + 1 if all_far(points) else 0
        if s.marks[code.FAR_POINTS] == LOOKS:
            s.marks[code.ODD] |= 2
