"""One robot's whole tick in one compiled call: what `SafetyController.step` does, by the same stages.

For compiled callers: `tick_compiled(*shared, *own, *work, q, qd, distances, ages, points, how)`.

    shared   4 blocks, `pack(controller).blocks`: floats, integers, then floats and integers of the sensing stage
    own      3 blocks of the robot: a row each of `State.floats`, `State.integers`, `State.spots`, from `new_state`
    work     2 blocks of the thread, from `new_work(packed, points)`: whatever they were used for before
    q, qd    measured (n,) [rad, rad/s]
    distances, ages   (k,) [m, s]; (0,) where points are given
    points   (p, 3) [m], p no more than `new_work` was told; (0, 3) where distances are given
    how      `DISTANCES`, `POINTS` or `NOTHING` of the two, see `code`

A caller that is an `entry` names `tick_kernel, *tick_kernel.USES` among what it uses. The tick returns the status, `OK`
to `FAULT`; everything else stands in the robot's blocks then, see `pack.own_of`.
"""

from __future__ import annotations

from math import inf, nan
from typing import Any

from numba import types

from qpsafe.batch import code, stages_kernel
from qpsafe.batch.blocks import OWN, SHARED, WORK
from qpsafe.batch.cuts import cut_own, cut_shared, cut_work
from qpsafe.batch.recovery_kernel import copy, update
from qpsafe.batch.stages_kernel import activate, errors, happen, resolve, sense, slowed
from qpsafe.batch.watch_kernel import watch_stall, watch_units
from qpsafe.compiled.by_reference import by_reference
from qpsafe.compiled.compiled import Array, entry, inline, linked, readable
from qpsafe.compiled.memory import view
from qpsafe.danger.evasion import filter_by
from qpsafe.gate import gate_kernel, stillness_kernel
from qpsafe.gate.braking_path import slow_down
from qpsafe.gate.gate_kernel import SHORT, WORTH_SAYING, let_through
from qpsafe.gate.stillness_kernel import hold_still
from qpsafe.pipeline.resolve_kernel import given
from qpsafe.pipeline.sense_kernel import (
    ENDS as WIRE_ENDS,
)
from qpsafe.pipeline.sense_kernel import (
    A,
    B,
    place_bodies,
)
from qpsafe.recovery.stall import HELD, SAID
from qpsafe.robot.kinematics import Index, cut, frame_pose

_filter_by, _given, _let_through = linked(filter_by), inline(given), linked(let_through, *gate_kernel.USES)
_hold_still = linked(hold_still, *stillness_kernel.USES)
#: All the code that goes into the kernel.
USES = (stages_kernel, gate_kernel, stillness_kernel, *stages_kernel.USES, *gate_kernel.USES)


@inline
def _plan(
    p: Any, s: Any, w: Any, spots: Array, f: Array, i: Index, q: Array, qd: Array, distances: Array, ages: Array,
    points: Array, how: int,
) -> int:  # fmt: skip
    """All that may fail; returns why, and fills `command`."""
    reason = sense(s, w, spots, f, i, p.whole[code.MOST], q, qd, distances, ages, points, how)
    if reason != code.NO_REASON:
        return reason
    least = activate(p, s, w, s.result[code.CDF_N])
    place_bodies(s.q, f, i, w.memory)
    bodies = cut(w.memory, s.q.shape[0], i[WIRE_ENDS])[0]
    for k in range(p.gains.shape[0]):
        frame_pose(bodies[p.bodies[k]], p.placements[k], w.poses[k])
    _, _, goals, twists, _, _, _, most = _given(w.given, s.q.shape[0], p.gains.shape[0])
    seen, leads, held = view(w.points, 0, (s.marks[code.COUNT], 3)), view(w.points, 0, (0,)), 0
    for j in range(most.shape[0]):
        most[j] = inf
    if p.gate.shape[0] > 0:
        held = _hold_still(p.gate, p.gate_whole, w.gate, w.gate_whole, w.memory, s.qd, seen, ages, leads, most)
    watch_stall(p, s, w, s.marks[code.CAPPED] == 1 or not least >= 1.0 or held > 0)
    update(p, s, w, s.result[code.CDF_N], least, goals, twists)
    for path in range(p.kinds.shape[0]):
        if p.kinds[path] == code.ENDS and s.clock[code.TIME] > p.periods[path]:
            return code.PATH_UNKNOWN
    excess, worst = resolve(p, s, w, f, i, least, held)
    if excess < 0.0:
        return code.LAW_ABSURD
    notes = 0
    if not excess <= 1e-9:
        notes |= code.LAW_EXCEEDED if excess == excess else code.LIMIT_GAVE_WAY
    if worst != 0.0:
        notes |= code.NOT_SOLVED
    if s.marks[code.CAPPED] == 1:
        slowed(p, s, w, i[WIRE_ENDS])
    if s.stall[HELD] == 1:
        slow_down(s.qd, p.limits[3], p.numbers[code.DT], w.command)
    if p.gate.shape[0] > 0:
        _let_through(
            p.gate, p.gate_whole, s.gate_known, w.gate, w.gate_whole, s.q, s.qd, w.command,
            seen, ages, leads, 1, s.gated,
        )  # fmt: skip
        if s.gated[SHORT] > WORTH_SAYING:
            notes |= code.TOO_LONG if s.gated[SHORT] == inf else code.TOO_NEAR
    watch_units(p, s, spots[1], distances, points, how == code.POINTS)
    if how == code.DISTANCES and (s.marks[code.OUT] > 0 or s.marks[code.STOPPED] == 1):
        notes |= code.SENSORS_SICK
    if s.marks[code.ODD] != 0:
        notes |= code.ODD_UNITS
    s.marks[code.NOTES] = notes + code.STALL * s.stall[SAID]
    errors(p, s, w)
    happen(p, s)
    return code.NO_REASON


@inline
def _keep(s: Any, w: Any) -> None:
    """Remember the clocks, to set them back when the robot could not go along."""
    copy(s.clock, w.clock)
    for k in range(s.tasks.shape[0]):
        copy(s.returns[k], w.returns[k])
        copy(s.tasks[k], w.tasks[k])
        copy(s.offsets[0, k], w.back[0, k])
        copy(s.offsets[1, k], w.back[1, k])
    if s.marks[code.WAY] == 1:
        copy(s.way, w.way)
        copy(s.way_marks, w.way_marks)
        copy(s.way_offsets[0], w.way_back[0])
        copy(s.way_offsets[1], w.way_back[1])


@inline
def _set_back(s: Any, w: Any, phase: int, way: int, way_phase: int) -> None:
    copy(w.clock, s.clock)
    s.marks[code.PHASE] = phase
    for k in range(s.tasks.shape[0]):
        copy(w.returns[k], s.returns[k])
        s.tasks[k, code.PENDING], s.tasks[k, code.RETURNING] = w.tasks[k, code.PENDING], w.tasks[k, code.RETURNING]
        copy(w.back[0, k], s.offsets[0, k])
        copy(w.back[1, k], s.offsets[1, k])
    if way == 1 and s.marks[code.WAY] == 1:
        s.marks[code.WAY_PHASE] = way_phase
        copy(w.way, s.way)
        s.way_marks[code.PENDING], s.way_marks[code.RETURNING] = w.way_marks[code.PENDING], w.way_marks[code.RETURNING]
        copy(w.way_back[0], s.way_offsets[0])
        copy(w.way_back[1], s.way_offsets[1])


@inline
def _brake(p: Any, s: Any, w: Any, f: Array, i: Index) -> None:
    """Brake towards standstill within the limits and hold, see `qpsafe.pipeline.braking.brake`."""
    n = s.q.shape[0]
    _filter_by(view(f, i[A], (n, n)), view(f, i[B], (n, n)), s.evasive, w.none, s.qd0)  # no danger is known: it fades
    copy(s.qd0, s.evasive)
    slow_down(s.qd, p.limits[3], p.numbers[code.DT], w.command)
    s.result[0], s.result[1], s.result[2] = nan, 0.0, 0.0
    s.gated[0], s.gated[1] = 1.0, 0.0
    s.marks[code.KEPT_LEVELS], s.marks[code.NOTES], s.marks[code.COUNT], s.marks[code.WAITS] = -1, 0, 0, 0
    for k in range(s.tasks.shape[0]):
        s.activations[k] = 0.0
    for row in range(s.errors.shape[0]):
        s.errors[row] = nan
    for path in range(s.happened.shape[0]):
        s.happened[path, 0], s.happened[path, 1] = s.cursors[path], 0


_block = types.Array(types.float64, 1, "C", readonly=True)
_whole_block = _block.copy(dtype=types.int64)
_out, _whole = types.float64[::1], types.int64[::1]
#: Types of the blocks.
BLOCKS = (_block, _whole_block, _block, _whole_block), (_out, _whole, types.boolean[:, ::1]), (_out, _whole)


@entry(
    types.int64(
        *BLOCKS[0], *BLOCKS[1], *BLOCKS[2],
        readable(1), readable(1), readable(1), readable(1), readable(2), types.int64,
    ),
    *USES,
)  # fmt: skip
def tick(
    floats: Array, integers: Index, f: Array, i: Index, own: Array, whole: Index, spots: Array, work: Array,
    work_whole: Index, q: Array, qd: Array, distances: Array, ages: Array, points: Array, how: int,
) -> int:  # fmt: skip
    """One tick of one robot, see above."""
    p = by_reference(cut_shared(floats, integers, view(integers, code.HEADS, (SHARED,)), integers))
    s = by_reference(cut_own(own, whole, view(integers, code.HEADS + SHARED, (OWN,)), integers))
    w = by_reference(cut_work(work, work_whole, view(work_whole, 1, (WORK,)), integers, work_whole[0]))
    phase, way, way_phase = s.marks[code.PHASE], s.marks[code.WAY], s.marks[code.WAY_PHASE]
    _keep(s, w)
    reason = _plan(p, s, w, spots, f, i, q, qd, distances, ages, points, how)
    if reason == code.NO_REASON:
        status = code.OK if s.marks[code.NOTES] == 0 else code.DEGRADED
    else:
        _set_back(s, w, phase, way, way_phase)
        _brake(p, s, w, f, i)
        status = code.FAULT if reason >= code.LAW_ABSURD else code.BAD_INPUT
    s.marks[code.STATUS], s.marks[code.REASON] = status, reason
    # the one place that takes the step, after all that could fail
    s.marks[code.SEQ] += 1
    copy(s.qd, s.before)
    copy(w.command, s.qd)
    for j in range(s.q.shape[0]):
        s.q[j] += w.command[j] * p.numbers[code.DT]
    return status


tick_compiled = linked(tick, *USES)
"""`tick` for compiled code."""
