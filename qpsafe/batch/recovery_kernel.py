"""`Recovery` for tasks whose numbers are known: the same steps, with a robot's block for its memory."""

from __future__ import annotations

from typing import Any

import numpy as np

from qpsafe.batch import code
from qpsafe.batch.reference_kernel import error_norm, event_time, measure, sample_all
from qpsafe.compiled.compiled import Array, inline
from qpsafe.recovery import steps
from qpsafe.recovery.return_kernel import JOINTS, MOVES, TURNS, copy, lead_back
from qpsafe.recovery.steps import BACK, DUE, FINITE, FOLLOWING, MET, RECOVERING, SUSPENDED
from qpsafe.tasks.joint import TURN
from qpsafe.tasks.offset import displace_into

_quiet_after = inline(steps.quiet_after)
START, SPEED_THEN, BEFORE = range(3)  # what is known of a task's offset


@inline
def not_met(p: Any, s: Any, w: Any, time: float, all_of_them: bool) -> int:
    """Bits of the essential tasks, or of those that are active too, that are off the path."""
    sample_all(p, w, time)
    measure(p, w)
    mask = 0
    for k in range(p.gains.shape[0]):
        asked = p.essential[k] == 1 and (all_of_them or s.activations[k] >= 1.0)
        if asked and not error_norm(p, w.offsets[k], k) <= p.numbers[code.TOLERANCE]:
            mask |= 1 << k
    return mask


@inline
def _answer(question: int, of: Any, time: float) -> bool:
    """See `qpsafe.recovery.steps`."""
    p, s, w = of
    if question == FINITE:  # has been looked at when the knots were made
        return True
    if question == DUE:
        due = False
        for path in range(p.kinds.shape[0]):
            due = due or event_time(p, path, s.cursors[path]) <= time
        return due
    if question == MET:
        return not_met(p, s, w, time, True) == 0
    mask = 0
    for k in range(p.gains.shape[0]):
        if s.tasks[k, code.PENDING] == 1 and s.activations[k] >= 1.0:
            mask |= 1 << k
    s.marks[code.WAITS] = mask if mask != 0 else not_met(p, s, w, time, False)
    return s.marks[code.WAITS] == 0


@inline
def _must_return(tasks: Array) -> None:
    for k in range(tasks.shape[0]):
        tasks[k, code.PENDING], tasks[k, code.RETURNING] = 1, 0


@inline
def lead(p: Any, s: Any) -> bool:
    """Return through the joints, straight to where all tasks were last met; see `Recovery.lead`."""
    if s.marks[code.PHASE] != RECOVERING or s.marks[code.LED] == 1 or p.whole[code.ENABLED] == 0:
        return False
    s.marks[code.LED] = s.marks[code.WAY] = s.marks[code.WAY_CHANGED] = 1
    s.marks[code.WAY_PHASE] = FOLLOWING
    s.way_marks[code.PENDING] = s.way_marks[code.RETURNING] = s.way_marks[code.KNOWN] = 0
    copy(s.met, s.posture)
    _must_return(s.tasks)
    for k in range(s.tasks.shape[0]):
        s.tasks[k, code.KNOWN] = 0
    return True


@inline
def _any_pending(s: Any) -> bool:
    pending = False
    for k in range(s.tasks.shape[0]):
        pending = pending or s.tasks[k, code.PENDING] == 1
    return pending


@inline
def on_path(s: Any) -> bool:
    """Whether the references of this tick are the tasks' own trajectories, in place if not in speed."""
    return not _any_pending(s)


@inline
def _reference(p: Any, s: Any, w: Any, k: int, active: bool, goal: Array, twist: Array) -> None:
    """Displace the reference of a pending task that stands in `goal` and `twist`."""
    rate, offset, first = w.drift[:6], w.shift[:6], p.ends[k - 1] if k > 0 else 0
    copy(w.offsets[k], offset)
    kind = (MOVES if p.rows[first] < 3 else 0) + (TURNS if p.rows[p.ends[k] - 1] >= 3 else 0)
    if lead_back(
        p.numbers, kind, active, offset, rate, s.tasks[k], s.returns[k], s.offsets[START, k], s.offsets[SPEED_THEN, k],
        s.offsets[BEFORE, k],
    ):  # fmt: skip
        displace_into(w.goals[p.paths[k]], twist, offset, rate, goal, twist)


@inline
def _answer_way(question: int, of: Any, time: float) -> bool:
    under_way, fine, met = of
    if question == MET:
        return met
    return question == FINITE or (question == BACK and not under_way and fine)


_next_phase, _advance = (inline(step) for step in steps.phases_by(_answer))
_next_phase_of_way = inline(steps.phases_by(_answer_way)[0])


@inline
def update_way(p: Any, s: Any, w: Any, least: float) -> bool:
    """One tick on the way back through the joints; False where it is over. Its reference: `shift`, `drift` (n,)."""
    n = s.q.shape[0]
    offset, rate = w.shift[:n], w.drift[:n]
    square = 0.0
    for j in range(n):
        offset[j] = s.q[j] - s.posture[j]
        if p.endless[j] == 1:
            offset[j] -= TURN * np.rint(offset[j] / TURN)
        square += offset[j] * offset[j]
    active, met = least >= 1.0, np.sqrt(square) <= p.numbers[code.TOLERANCE]
    of = (s.way_marks[code.PENDING] == 1 and active, met or not active, met)
    phase, anew = _next_phase_of_way(s.marks[code.WAY_PHASE], s.marks[code.WAY_CHANGED] == 1, False, False, 0.0, of)
    s.marks[code.WAY_CHANGED], s.marks[code.WAY_PHASE] = 0, phase
    if anew:
        s.way_marks[code.PENDING], s.way_marks[code.RETURNING] = 1, 0
    if phase == FOLLOWING:
        s.marks[code.WAY] = 0  # there: what is left is the way from a posture that met the tasks
        return False
    there = s.way_marks[code.PENDING] == 0 or not lead_back(
        p.numbers, JOINTS, active, offset, rate, s.way_marks, s.way, s.way_offsets[START], s.way_offsets[SPEED_THEN],
        s.way_offsets[BEFORE],
    )  # fmt: skip
    if there:
        offset[:], rate[:] = 0.0, 0.0
    return True


@inline
def update(p: Any, s: Any, w: Any, cdf_n: float, least: float, goals: Array, twists: Array) -> None:
    """Advance one tick and give each task its reference, see `Recovery.update`; on the way back, `shift` and `drift`.

    `poses` has the tasks' frames, `activations` theirs; `goals` (N, 4, 4) and `twists` (N, 6) are filled in.
    """
    of, before = (p, s, w), s.marks[code.PHASE]
    danger = p.whole[code.ENABLED] == 1 and not cdf_n <= p.numbers[code.SUSPEND]
    s.marks[code.WAITS] = 0
    s.clock[code.QUIET] = _quiet_after(s.clock[code.QUIET], cdf_n, p.numbers[code.CALM], p.numbers[code.DT])
    waits = s.clock[code.QUIET] <= p.numbers[code.DWELL]
    phase, anew = _next_phase(before, s.marks[code.CHANGED] == 1, danger, waits, s.clock[code.TIME], of)
    s.marks[code.CHANGED], s.marks[code.PHASE] = 0, phase
    if anew:
        s.clock[code.RATE] = 0.0
        s.marks[code.WAY] = s.marks[code.LED] = 0
        _must_return(s.tasks)
    elif before == FOLLOWING and phase == FOLLOWING:
        step, dt = p.numbers[code.STEP], p.numbers[code.DT]
        time, rate, waits = _advance(
            s.clock[code.TIME], s.clock[code.RATE], s.marks[code.PAUSED] == 1, step, dt, p.event_times.shape[0] > 0, of
        )  # fmt: skip
        if waits:
            s.marks[code.WAITS] = not_met(p, s, w, s.clock[code.TIME], True)
        s.clock[code.TIME], s.clock[code.RATE] = time, rate
    if s.marks[code.WAY] == 1 and phase != SUSPENDED and update_way(p, s, w, least):
        return
    sample_all(p, w, s.clock[code.TIME])
    pending = _any_pending(s)
    if pending:
        measure(p, w)
    held = before == SUSPENDED and phase == SUSPENDED and (p.whole[code.HELD] == 1 or not danger)
    share = s.clock[code.RATE] if phase == FOLLOWING else 0.0
    if s.marks[code.WAITS] != 0 and not pending and share == 1.0:
        share = 0.0  # a reference that moved on would keep the tasks from the event they wait at
    for k in range(p.gains.shape[0]):
        path = p.paths[k]
        for a in range(4):
            copy(w.goals[path, a], goals[k, a])
        for c in range(6):
            twists[k, c] = share * w.twists[path, c]
        if phase == SUSPENDED and not held:
            copy(w.offsets[k], s.offsets[BEFORE, k])
            s.tasks[k, code.KNOWN] = 1
        elif s.tasks[k, code.PENDING] == 1:
            _reference(p, s, w, k, s.activations[k] >= 1.0 and not held, goals[k], twists[k])
