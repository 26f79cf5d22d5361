"""The compiled stage of the laws beside the strict one, in place of the regimes that `resolve_tick` solves.

    paper       q̇ = Σ_k w_k q̇_k,  q̇_k = [J_1 q̇ = ẋ_1 ≻ min ||q̇ - (Σ_(i>=2) N_(i-1) P(J_i) ẋ_i + N_k q̇0)||²]
    null space  the same without limits, by projections alone, (18), (22); what exceeds the box is clipped afterwards
    weighted    min Σ_k a_k w_k ||J_k q̇ - ẋ_k||² + w_E ||q̇ - q̇0||²

Rows of the tasks, box and weights of the regimes stand in the blocks of `resolve_tick` already.
"""

from __future__ import annotations

import numpy as np
from numba import types

from qpsafe import limits as limits_module
from qpsafe.compiled.compiled import Array, entry, linked
from qpsafe.compiled.memory import view
from qpsafe.hqp.own import regimes
from qpsafe.hqp.own.regimes import solve_levels, solve_regime
from qpsafe.hqp.own.solver import MODULES
from qpsafe.laws import damping as laws_damping
from qpsafe.laws import kinds, nullspace, projections, weighted
from qpsafe.laws.damping import threshold_compiled
from qpsafe.laws.kinds import NULLSPACE, WEIGHTED
from qpsafe.laws.nullspace import blend_compiled
from qpsafe.laws.projections import regimes_compiled
from qpsafe.laws.weighted import into_one_compiled
from qpsafe.pipeline import checks, resolve_kernel
from qpsafe.pipeline.resolve_kernel import cut_given, cut_parts, layout_types, sent
from qpsafe.robot.kinematics import Index

_one = types.Array(types.float64, 1, "C", readonly=True)
_out, _out_ints = types.float64[::1], types.int64[::1]
#: All the code that goes into the kernel.
USES = (
    resolve_kernel, checks, limits_module, laws_damping, kinds, nullspace, projections, weighted, regimes,
    *projections.USES, *MODULES,
)  # fmt: skip


@entry(
    types.UniTuple(types.float64, 2)(
        types.int64, types.float64, types.float64, _one, _one, types.float64, _out,
        *layout_types, _out, _out_ints, _out,
    ),
    *USES,
)  # fmt: skip
def law_tick(
    kind: int, damping: float, damping_time: float, importance: Array, activations: Array, dt: float, block: Array,
    work: Array, int_work: Index, m: int, matrix: Array, target: Array, last: Index, ends: Index, levels: Array,
    soft: Index, floats: Array, integers: Index, command: Array,
) -> tuple[float, float]:  # fmt: skip
    """Fill the law's part of floats and integers, see `Parts`, and command.

    Args:
        kind: Of `qpsafe.laws.kinds`, not `STRICT`.
        damping, damping_time, importance: Its numbers, see `numbers_of`.
        activations: (tasks,).
        dt: Tick [s].
        block: What `given` cuts, with gains, weights and q̇0.
        work, int_work, m, matrix, target, last, ends, levels, soft: A `Layout` of the solver, of one level where the
            law is weighted.
        floats, integers: As `resolve_tick` left them.
        command: (n,), q̇ inside the box.

    Returns:
        As `resolve_tick`.
    """  # fmt: skip
    n, tasks = command.shape[0], ends.shape[0]
    A, b, e, x, bounds, blend, codes, info = cut_parts(floats, integers, n, ends[tasks - 1], tasks + 1)
    gains, _, _, _, weights, near, qd0, _ = cut_given(block, n, tasks)
    width = info.shape[1]
    for level in range(tasks + 1):
        near[level] = 0.0
    if kind == WEIGHTED:
        rows, first = n + ends[tasks - 1], soft[1]
        into_one_compiled(
            A, b, ends, qd0, activations, importance, view(matrix, first * n, (rows, n)),
            view(target, target.shape[1] + first, (rows,)),
        )  # fmt: skip
        last[soft[0]] = first + rows
        solve_levels(
            work, int_work, m, matrix, target, last, levels, soft, 1, bounds[0], bounds[1], near, x[0],
            view(info, 0, (width,)),
        )  # fmt: skip
        for j in range(n):
            blend[j] = x[0, j]
        return sent(blend, bounds, codes, info, dt, command)
    most = 0  # tasks that are kept at all
    for kept in range(1, tasks + 1):
        if weights[kept] > 0.0:
            most = kept
    spared = 0 if kind == NULLSPACE else 1
    if spared == 0 or most > 1:
        fine = regimes_compiled(A, b, view(ends, 0, (most,)), qd0, spared, work, view(x, 0, (most + 1, n)))
        if not fine:
            for j in range(n):
                command[j] = np.nan
            return -1.0, 0.0
    if kind != NULLSPACE:
        _, near[0] = threshold_compiled(damping * damping, gains[0], e[: ends[0]], damping_time)
        for kept in range(most + 1):
            if weights[kept] > 0.0:
                solve_regime(
                    work, int_work, m, matrix, target, last, ends, levels, soft, A, b, min(kept, 1),
                    x[kept] if kept > 1 else qd0, bounds[0], bounds[1], near, x[kept],
                    view(info, kept * width, (width,)),
                )  # fmt: skip
    blend_compiled(weights, view(x, 0, (most + 1, n)), blend)
    return sent(blend, bounds, codes, info, dt, command)


law_compiled = linked(law_tick, *USES)
"""`law_tick` for compiled code."""
