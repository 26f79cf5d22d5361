"""The compiled stages of the second half of a tick, and the call they are composed to.

    tasks on poses --CLIK--> J, ẋ;   limits --> box;   J, ẋ, q̇0, weights, box --regimes--> q̇;   q̇ --box--> command

A stage of another making has been asked before: rows of a task, or a box, that stand in the results already.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import types

from qpsafe import limits as limits_module
from qpsafe.compiled.compiled import Array, entry, inline, readable
from qpsafe.compiled.memory import view
from qpsafe.hqp.own import regimes
from qpsafe.hqp.own.hierarchy import HEADER
from qpsafe.hqp.own.regimes import solve_regimes
from qpsafe.hqp.own.solver import MODULES
from qpsafe.laws import damping as laws_damping
from qpsafe.laws import yielding as laws_yielding
from qpsafe.laws.damping import threshold_compiled
from qpsafe.laws.yielding import yield_to
from qpsafe.limits import JERK, KINDS, admit_into, box_into
from qpsafe.pipeline import checks
from qpsafe.pipeline.checks import ABSURD_STEP
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut
from qpsafe.tasks import clik
from qpsafe.tasks.clik import pose_rows


class Parts(NamedTuple):
    """Results of `resolve_tick`; n joints, a regime more than tasks.

    Attributes:
        A: Jacobians of the tasks (rows, n).
        b: ẋ = ẋ_d + K e (rows,).
        e: Errors (rows,).
        x: q̇ of each regime (regimes, n).
        bounds: Box, lower and upper (2, n).
        blend: The law's q̇ (n,).
        codes: Kinds of the box's limits, lower, upper, sacrificed (3, n).
        info: What the solver says of each regime (regimes, 3 + 2 n + rows, soft ones among them).
    """

    A: Array
    b: Array
    e: Array
    x: Array
    bounds: Array
    blend: Array
    codes: Index
    info: Index


def parts(floats: Array, integers: Index, n: int, rows: int, kinds: int) -> tuple[Any, ...]:
    """Cut `Parts` from two blocks.

    Args:
        floats: `sizes_of` says how many.
        integers: The same.
        n: Joints.
        rows: Of all tasks.
        kinds: Regimes.
    """
    a = rows * n
    b = a + 2 * rows
    c = b + kinds * n
    return (
        view(floats, 0, (rows, n)),
        view(floats, a, (rows,)),
        view(floats, a + rows, (rows,)),
        view(floats, b, (kinds, n)),
        view(floats, c, (2, n)),
        view(floats, c + 2 * n, (n,)),
        view(integers, 0, (3, n)),
        view(integers, 3 * n, (kinds, (integers.shape[0] - 3 * n) // kinds)),
    )


def sizes_of(n: int, rows: int, kinds: int, soft: int = 0) -> tuple[int, int]:
    """How many floats and integers these are.

    Args:
        n: Joints.
        rows: Of all tasks.
        kinds: Regimes.
        soft: Rows of soft levels.
    """
    return rows * n + 2 * rows + (3 + kinds) * n, 3 * n + kinds * (HEADER + 2 * n + rows + soft)


def given(block: Array, n: int, tasks: int) -> tuple[Any, ...]:
    """Cut from a block what changes every tick.

    These are gains (tasks,); which tasks' rows stand already, 1 or 0 (tasks,); goals (tasks, 4, 4); twists (tasks, 6);
    weights of the regimes (tasks + 1,); damping of the levels (tasks + 1,), filled in by the call; q̇0 (n,); the largest
    speeds of joints that are to stand, infinite for the others (n,).

    Args:
        block: The floats.
        n: Joints.
        tasks: How many.
    """
    return (
        view(block, 0, (tasks,)),
        view(block, tasks, (tasks,)),
        view(block, 2 * tasks, (tasks, 4, 4)),
        view(block, 18 * tasks, (tasks, 6)),
        view(block, 24 * tasks, (tasks + 1,)),
        view(block, 25 * tasks + 1, (tasks + 1,)),
        view(block, 26 * tasks + 2, (n,)),
        view(block, 26 * tasks + 2 + n, (n,)),
    )


cut_parts, cut_given = inline(parts), inline(given)
STILLNESS = KINDS.index("stillness")
#: All the code that goes into `resolve_tick`.
USES = (kinematics, clik, limits_module, laws_damping, laws_yielding, regimes, checks, *MODULES)
_one, _two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))
_any, _ints, _out, _out_ints = readable(1), _one.copy(dtype=types.int64), types.float64[::1], types.int64[::1]
#: Of a `Layout`.
layout_types = (
    _out, _out_ints, types.int64, types.float64[:, ::1], types.float64[:, ::1], _out_ints, _ints, _out, _ints,
)  # fmt: skip


@inline
def hold_into(most: Array, bounds: Array, codes: Index) -> None:
    """Narrow the box to speeds of at most `most` (n,), as far as that leaves something; jerk limits give way."""
    for i in range(most.shape[0]):
        above = most[i] < bounds[0, i] and codes[0, i] == JERK
        below = -most[i] > bounds[1, i] and codes[1, i] == JERK
        if above:
            bounds[0, i] = most[i]
        if below:
            bounds[1, i] = -most[i]
        if (above or below) and codes[2, i] == 0:
            codes[2, i] = JERK
        if most[i] < bounds[1, i]:
            bounds[1, i], codes[1, i] = max(bounds[0, i], most[i]), STILLNESS
        if -most[i] > bounds[0, i]:
            bounds[0, i], codes[0, i] = min(bounds[1, i], -most[i]), STILLNESS


@inline
def sent(blend: Array, bounds: Array, codes: Index, info: Index, dt: float, command: Array) -> tuple[float, float]:
    """Check the law's q̇: finite, sane; and bring it inside the box. Returns what `resolve_tick` does."""
    sane = True
    for i in range(blend.shape[0]):
        command[i] = blend[i]
        sane = sane and abs(blend[i]) * dt < ABSURD_STEP  # false for NaN
    if not sane:
        return -1.0, 0.0
    worst = 0
    for kept in range(info.shape[0]):
        worst = max(worst, info[kept, 0])
    return admit_into(blend, bounds[0], bounds[1], codes[2], command), float(worst)


@entry(
    types.UniTuple(types.float64, 2)(
        _any, _any, _one, _two, types.int64, _ints, _three, _ints, types.float64[::1], readable(2), types.float64,
        types.float64, types.float64, types.float64,
        *layout_types, _out, _out_ints, _out,
    ),
    *USES,
)  # fmt: skip
def resolve_tick(
    q: Array, qd: Array, memory: Array, supports: Array, k: int, bodies: Index, placements: Array, rows: Index,
    block: Array, limits: Array, dt: float, return_speed: float, damping: float,
    damping_time: float,
    work: Array, int_work: Index, m: int, matrix: Array, target: Array, last: Index, ends: Index, levels: Array,
    soft: Index, floats: Array, integers: Index, command: Array,
) -> tuple[float, float]:  # fmt: skip
    """Fill floats and integers (see `Parts`), command.

    Args:
        q, qd, memory: Commanded position, velocity (n,), and kinematics.
        supports, k: Of the robot's tree, and ends of its wire.
        bodies, placements, rows: Of the tasks' frames (tasks,), (tasks, 4, 4); of all their rows which of x, y, z, and
            the rotation about them (rows,).
        block: What `given` cuts.
        limits: Lower, upper, velocity, acceleration (4, n), or (0, n) where the box stands already.
        dt, return_speed: Of the limits.
        damping, damping_time: Of the law; NaN where it is of another making and will be asked afterwards.
        work, int_work, m, matrix, target, last, ends, levels, soft: A `Layout` of the solver.
        floats, integers: Results, zeros but for what stands already.
        command: (n,), q̇ inside the box.

    Returns:
        By how much the law's q̇ was outside, -1 if it is absurd; the worst code of the solver.
    """  # fmt: skip
    n, tasks = q.shape[0], bodies.shape[0]
    A, b, e, x, bounds, blend, codes, info = cut_parts(floats, integers, n, rows.shape[0], tasks + 1)
    gains, standing, goals, twists, weights, near, qd0, most = cut_given(block, n, tasks)
    poses, axes, _, _ = cut(memory, n, k)
    square = damping * damping
    # CLIK: ẋ = ẋ_d + K e
    for t in range(tasks):
        first, stop = (ends[t - 1] if t > 0 else 0), ends[t]
        if standing[t] == 0.0:
            pose_rows(
                poses, axes, supports[bodies[t]], bodies[t], placements[t], rows[first:stop], gains[t], goals[t],
                twists[t], A[first:stop], b[first:stop], e[first:stop],
            )  # fmt: skip
        if soft[2] > 0:
            yield_to(
                A[first:stop], b[first:stop], view(matrix, 0, (soft[2], n)), view(target, target.shape[1], (soft[2],)),
                view(work, 0, (stop - first, stop - first + 1)),
            )  # fmt: skip
        square, near[t] = threshold_compiled(square, gains[t], e[first:stop], damping_time)
    near[tasks] = 0.0  # the level that closes the hierarchy has none
    if limits.shape[0] > 0:
        box_into(q, qd, limits[0], limits[1], limits[2], limits[3], dt, return_speed, bounds, codes)
    hold_into(most, bounds, codes)
    if damping != damping:
        return 0.0, 0.0
    # regimes of the law within the box, blended
    solve_regimes(
        work, int_work, m, matrix, target, last, ends, levels, soft, A, b, weights, qd0, bounds[0], bounds[1], near, x,
        info, blend,
    )  # fmt: skip
    return sent(blend, bounds, codes, info, dt, command)
