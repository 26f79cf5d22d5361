"""The stages of one robot's tick, over its blocks: the compiled stages of `qpsafe.pipeline`, composed."""

from __future__ import annotations

from math import inf, isfinite, nan
from typing import Any

import numpy as np

from qpsafe import limits as limits_module
from qpsafe.batch import blocks, code, cuts, recovery_kernel, reference_kernel, watch_kernel
from qpsafe.batch.recovery_kernel import copy, on_path
from qpsafe.batch.reference_kernel import event_time, measure, sample_all
from qpsafe.compiled import by_reference as reference_module
from qpsafe.compiled.compiled import Array, inline, linked
from qpsafe.compiled.memory import view
from qpsafe.danger import activation
from qpsafe.danger.activation import multiply_compiled, switch_compiled
from qpsafe.danger.evasion import filter_by
from qpsafe.geometry import clearance_kernel
from qpsafe.geometry.clearance_kernel import clearance_rows
from qpsafe.geometry.clearance_work import cut_rows
from qpsafe.hqp.own import regimes
from qpsafe.hqp.own.solver import MODULES
from qpsafe.laws import damping, hierarchical
from qpsafe.laws.hierarchical import weigh_compiled
from qpsafe.laws.kinds import STRICT
from qpsafe.limits import box_into
from qpsafe.pipeline import braking, law_kernel, resolve_kernel, sense_kernel
from qpsafe.pipeline.law_kernel import law_compiled
from qpsafe.pipeline.resolve_kernel import given, parts, resolve_tick
from qpsafe.pipeline.sense_kernel import (
    ENDS as WIRE_ENDS,
)
from qpsafe.pipeline.sense_kernel import (
    SUPPORTS,
    is_measurement,
    sense_points,
    sense_readings,
)
from qpsafe.ranging.ranged import COLUMNS
from qpsafe.recovery import return_kernel, stall, steps
from qpsafe.recovery.steps import RECOVERING
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut
from qpsafe.sensing import detection, readings, speed_cap, units
from qpsafe.sensing.speed_cap import fastest
from qpsafe.tasks import clik, joint, offset
from qpsafe.tasks.joint import TURN

_sense_readings = linked(sense_readings, *sense_kernel.USES, readings, *readings.USES)
_sense_points = linked(sense_points, *sense_kernel.USES, detection)
_resolve_tick = linked(resolve_tick, *resolve_kernel.USES)
_clearance_rows = linked(clearance_rows, *clearance_kernel.USES)
_filter_by = linked(filter_by)
_parts, _given = inline(parts), inline(given)


#: All the code that goes into the kernel.
USES = (
    code, blocks, cuts, recovery_kernel, reference_kernel, watch_kernel, reference_module, activation, hierarchical,
    limits_module, braking, resolve_kernel, sense_kernel, stall, steps, return_kernel, kinematics, speed_cap, units,
    clik, offset, detection, readings, damping, clearance_kernel, *clearance_kernel.USES, *resolve_kernel.USES,
    regimes, joint, law_kernel, *law_kernel.USES, *sense_kernel.USES, *readings.USES, *MODULES,
)  # fmt: skip


@inline
def activate(p: Any, s: Any, w: Any, cdf_n: float) -> float:
    """Switches, activations, levels kept; returns the least activation."""
    kept, levels = 0, p.levels.shape[0]
    for k in range(levels):
        w.switches[k] = switch_compiled(cdf_n, p.levels[k, 0], p.levels[k, 1], p.levels[k, 2], p.levels[k, 3])
        kept += 1 if cdf_n <= p.levels[k, 0] else 0
    multiply_compiled(w.switches[:levels], p.counts, s.activations)
    s.marks[code.KEPT_LEVELS] = kept
    s.result[1], s.result[2] = w.switches[0], w.switches[1] if levels > 1 else 1.0
    return s.activations[s.activations.shape[0] - 1]


@inline
def sense(
    s: Any, w: Any, spots: Array, f: Array, i: Index, most: int, q: Array, qd: Array, distances: Array, ages: Array,
    points: Array, how: int,
) -> int:  # fmt: skip
    """The first half of a tick; CDF_n and q̇0 into the robot's block. Returns why it cannot be used."""
    sane = is_measurement(q, qd, f, i)
    if sane and s.marks[code.ACTIVE] == 0:  # the commanded configuration starts where the robot is
        copy(q, s.q)
        s.marks[code.ACTIVE] = 1
        for j in range(s.q.shape[0]):
            s.qd[j] = s.before[j] = 0.0
    if how == code.NOTHING:
        return code.NOTHING_GIVEN if sane else code.NO_MEASUREMENT
    spots_count = s.age.shape[0]
    if how == code.DISTANCES and spots_count == 0:
        return code.NO_SPOTS if sane else code.NO_MEASUREMENT
    too_many = how == code.POINTS and points.shape[0] > w.links.shape[0]
    if too_many or (how == code.DISTANCES and not distances.shape[0] == ages.shape[0] == spots_count):
        return code.WRONG_SIZE
    s.marks[code.CAPPED] = 0
    nobody, nowhere = view(w.points, 0, (0, COLUMNS)), view(w.links, 0, (0,))  # a batch takes no images
    if how == code.DISTANCES:
        count, dying, out, cdf_n = _sense_readings(
            q, qd, distances, ages, nobody, nowhere, f, i, s.counts, s.seen, spots[0], s.held, s.age, s.track,
            s.evasive, w.sensing, w.points, w.links, w.danger, w.vectors, s.qd0,
        )  # fmt: skip
        if count < 0:
            return code.NO_MEASUREMENT
        s.marks[code.DYING], s.marks[code.OUT] = dying, out
        if dying > most:
            s.marks[code.STOPPED] = 1
        if s.marks[code.STOPPED] == 1 or out > most:
            return code.OUT_OF_ORDER
        s.marks[code.CAPPED] = 1 if dying > 0 else 0
    else:
        given_points = points.shape[0]
        count, cdf_n = _sense_points(
            q, qd, points, nobody, nowhere, f, i, s.evasive, w.sensing, view(w.points, 0, (given_points, 3)),
            view(w.links, 0, (given_points,)), view(w.danger, 0, (given_points,)),
            view(w.vectors, 0, (given_points, 3)), s.qd0,
        )  # fmt: skip
        if count == -1:
            return code.NO_MEASUREMENT
        if count < 0:
            return code.POINT_NOT_FINITE
    if not isfinite(cdf_n):  # never into the filter, which remembers
        return code.DANGER_NOT_FINITE
    copy(s.qd0, s.evasive)
    s.result[code.CDF_N], s.marks[code.COUNT] = cdf_n, count
    return code.NO_REASON


@inline
def gentle(p: Any, s: Any, w: Any) -> bool:
    """Whether the gentle limits of the way back leave all the others met."""
    g = p.gentle
    box_into(s.q, s.qd, g[0], g[1], g[2], g[3], p.numbers[code.DT], p.numbers[code.RETURN_SPEED], w.bounds, w.codes)
    met = True
    for j in range(s.q.shape[0]):
        met = met and w.codes[2, j] == 0
    return met


@inline
def keep_clear(p: Any, s: Any, w: Any, memory: Array, limits: Array, dt: float) -> None:
    """Rows that keep the robot clear of furniture and itself, above the tasks."""
    count = 0
    if p.solids.shape[0] > 0:
        count = _clearance_rows(
            memory, s.qd, limits, dt, p.solids, p.solids_whole, w.clearance, w.clearance_whole
        )  # fmt: skip
    w.soft[0], w.soft[1], w.soft[2] = min(count, 1), count, count
    if count > 0:
        n = s.q.shape[0]
        rows = cut_rows(w.clearance, w.clearance_whole, n, p.solids_whole[2])
        for row in range(count):
            copy(rows.A[row], w.matrix[row])
            w.target[0, row], w.target[1, row] = -inf, rows.high[row]
        w.last[0] = count


@inline
def resolve(p: Any, s: Any, w: Any, f: Array, i: Index, least: float, held: int) -> tuple[float, float]:
    """The second half of a tick: from references and q̇0 to `command`, see `resolve_tick`."""
    n, tasks, k = s.q.shape[0], p.gains.shape[0], i[WIRE_ENDS]
    limits, dt, return_speed = p.limits, p.numbers[code.DT], p.numbers[code.RETURN_SPEED]
    supports, memory = view(f, i[SUPPORTS], (n + 1, n)), view(w.memory, 0, (w.memory.shape[0],))
    keep_clear(p, s, w, memory, limits, dt)
    if s.marks[code.PHASE] == RECOVERING and w.soft[1] == 0 and held == 0 and gentle(p, s, w):
        limits = p.gentle
    if s.marks[code.WAY] == 0:
        gains, standing, _, _, weights, _, qd0, _ = _given(w.given, n, tasks)
        copy(p.gains, gains)
        weigh_compiled(s.activations, weights)
        copy(s.qd0, qd0)
        for a in range(tasks):
            standing[a] = 0.0
        for a in range(w.floats.shape[0]):
            w.floats[a] = 0.0
        for a in range(w.integers.shape[0]):
            w.integers[a] = 0
        kind = p.whole[code.LAW]
        excess, worst = _resolve_tick(
            s.q, s.qd, memory, supports, k, p.bodies, p.placements, p.rows, w.given, limits, dt,
            return_speed, p.numbers[code.DAMPING] if kind == STRICT else nan, p.numbers[code.DAMPING_TIME], w.solver,
            w.solver_whole, p.whole[code.LARGEST], w.matrix, w.target, w.last, p.ends, w.near,
            w.soft, w.floats, w.integers, w.command,
        )  # fmt: skip
        if kind != STRICT:
            excess, worst = law_compiled(
                kind, p.numbers[code.DAMPING], p.numbers[code.DAMPING_TIME], p.importance, s.activations, dt, w.given,
                w.solver, w.solver_whole, p.whole[code.LARGEST], w.matrix, w.target, w.last, p.ends, w.near,
                w.soft, w.floats, w.integers, w.command,
            )  # fmt: skip
        return excess, worst
    # back through the joints: one task on all of them, whose rows stand already
    gains, standing, _, _, weights, _, qd0, most = _given(w.way_given, n, 1)
    copy(_given(w.given, n, tasks)[7], most)
    gains[0], standing[0] = p.numbers[code.WAY_GAIN], 1.0
    weights[0], weights[1] = 1.0 - least, least
    copy(s.qd0, qd0)
    for a in range(w.way_floats.shape[0]):
        w.way_floats[a] = 0.0
    for a in range(w.way_integers.shape[0]):
        w.way_integers[a] = 0
    J, b, e, _, _, _, _, _ = _parts(w.way_floats, w.way_integers, n, n, 2)
    for j in range(n):
        wanted = s.posture[j] + w.shift[j]
        error = s.q[j] - wanted
        if p.endless[j] == 1:
            error -= TURN * np.rint(error / TURN)
        J[j, j], e[j], b[j] = 1.0, -error, w.drift[j] - gains[0] * error
    return _resolve_tick(
        s.q, s.qd, memory, supports, k, view(p.nowhere, n, (1,)), w.way_placement, view(p.nowhere, 0, (n,)),
        w.way_given, limits, dt, return_speed, p.numbers[code.WAY_DAMPING], p.numbers[code.WAY_DAMPING_TIME],
        w.solver, w.solver_whole, p.whole[code.LARGEST_WAY], w.matrix, w.target, w.last, view(p.nowhere, n + 1, (1,)),
        w.near, w.soft, w.way_floats, w.way_integers, w.command,
    )  # fmt: skip


@inline
def slowed(p: Any, s: Any, w: Any, k: int) -> None:
    """No point of the wire faster than the cap: a sector is unseen; see `qpsafe.sensing.speed_cap.slowed`."""
    n = s.q.shape[0]
    speed = fastest(w.command, cut(w.memory, n, k)[3])
    if speed <= p.numbers[code.CAP]:
        return
    if s.marks[code.WAY] == 0:
        _, _, _, _, bounds, _, _, _ = _parts(w.floats, w.integers, n, p.rows.shape[0], p.gains.shape[0] + 1)
    else:
        _, _, _, _, bounds, _, _, _ = _parts(w.way_floats, w.way_integers, n, n, 2)
    share = p.numbers[code.CAP] / speed
    for j in range(n):
        w.command[j] = min(max(w.command[j] * share, bounds[0, j]), bounds[1, j])


@inline
def happen(p: Any, s: Any) -> None:
    """Pass the events that the path has come to: each does so once."""
    for path in range(p.kinds.shape[0]):
        s.happened[path, 0] = s.cursors[path]
        while event_time(p, path, s.cursors[path]) <= s.clock[code.TIME]:
            s.cursors[path] += 1
        s.happened[path, 1] = s.cursors[path] - s.happened[path, 0]


@inline
def errors(p: Any, s: Any, w: Any) -> None:
    """Errors of the tasks against their own trajectories."""
    rows, tasks = p.rows.shape[0], p.gains.shape[0]
    if on_path(s) and s.marks[code.WAY] == 0:
        _, _, e, _, _, _, _, _ = _parts(w.floats, w.integers, s.q.shape[0], rows, tasks + 1)
        copy(e, s.errors)
        return
    sample_all(p, w, s.clock[code.TIME])
    measure(p, w)
    for task in range(tasks):
        for row in range(p.ends[task - 1] if task > 0 else 0, p.ends[task]):
            s.errors[row] = -w.offsets[task, p.rows[row]]
