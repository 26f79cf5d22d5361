"""The compiled half of `qpsafe.resolve`: tasks on poses, joint limits and all regimes of the law in one call."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import types

from qpsafe import limits as limits_module
from qpsafe.checks import ABSURD_STEP
from qpsafe.danger.compiled import Array, entry, inline, readable
from qpsafe.danger.memory import view
from qpsafe.hqp import own_regimes
from qpsafe.hqp.own_hierarchy import HEADER
from qpsafe.hqp.own_regimes import solve_regimes
from qpsafe.hqp.own_solver import MODULES
from qpsafe.laws import damping as laws_damping
from qpsafe.laws.damping import threshold_compiled
from qpsafe.limits import admit_into, box_into
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut
from qpsafe.tasks import clik
from qpsafe.tasks.clik import pose_rows


class Parts(NamedTuple):
    """Results of `resolve_quickly`; n joints, a regime more than tasks.

    Attributes:
        A: Jacobians of the tasks (rows, n).
        b: ẋ = ẋ_d + K e (rows,).
        e: Errors (rows,).
        x: q̇ of each regime (regimes, n).
        bounds: Box, lower and upper (2, n).
        blend: The law's q̇ (n,).
        codes: Kinds of the box's limits, lower, upper, sacrificed (3, n).
        info: What the solver says of each regime (regimes, 3 + 2 n + rows).
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
    """Cut `Parts` from two blocks."""
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
        view(integers, 3 * n, (kinds, HEADER + 2 * n + rows)),
    )


_cut = inline(parts)
_one, _two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))
_any, _ints = readable(1), types.Array(types.int64, 1, "C", readonly=True)


@entry(
    types.UniTuple(types.float64, 2)(
        _any, _any, _one, _two, types.int64, _ints, _three, _ints, readable(2), types.float64, types.float64,
        _one, readable(3), readable(2), _one, _one, types.float64, types.float64,
        types.float64[::1], types.int64[::1], types.int64, types.float64[:, ::1], types.float64[::1], types.int64[::1],
        _ints, types.float64[::1], types.int64[::1], types.float64[::1],
    ),
    kinematics, clik, limits_module, laws_damping, own_regimes, *MODULES,
)  # fmt: skip
def resolve_quickly(
    q: Array, qd: Array, memory: Array, supports: Array, k: int, bodies: Index, placements: Array, rows: Index,
    limits: Array, dt: float, return_speed: float, gains: Array, goals: Array, twists: Array, qd0: Array,
    weights: Array, damping: float, damping_time: float, work: Array, int_work: Index, m: int, matrix: Array,
    target: Array, last: Index, ends: Index, floats: Array, integers: Index, command: Array,
) -> tuple[float, float]:  # fmt: skip
    """Fill floats and integers (zeros; see `Parts`), command; returns excess, -1 if q̇ is absurd, and the worst code."""
    A, b, e, x, bounds, blend, codes, info = _cut(floats, integers, q.shape[0], rows.shape[0], weights.shape[0])
    poses, axes, _, _ = cut(memory, q.shape[0], k)
    # damping of each level, after the results; the closing one has none
    near, square = view(floats, floats.shape[0] - weights.shape[0], (weights.shape[0],)), damping * damping
    # CLIK: ẋ = ẋ_d + K e
    for t in range(bodies.shape[0]):
        first, stop = (ends[t - 1] if t > 0 else 0), ends[t]
        pose_rows(
            poses, axes, supports[bodies[t]], bodies[t], placements[t], rows[first:stop], gains[t], goals[t],
            twists[t], A[first:stop], b[first:stop], e[first:stop],
        )  # fmt: skip
        square, near[t] = threshold_compiled(square, gains[t], e[first:stop], damping_time)
    # limits -> box; regimes of the law within it, blended
    box_into(q, qd, limits[0], limits[1], limits[2], limits[3], dt, return_speed, bounds, codes)
    solve_regimes(
        work, int_work, m, matrix, target, last, ends, A, b, weights, qd0, bounds[0], bounds[1], near, x, info,
        blend,
    )  # fmt: skip
    # checked: finite, sane, inside the box
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
