"""All regimes of a blend in one call: the own solver on the hierarchies that keep the first 0, 1, ... tasks.

    q̇ = Σ_k w_k q̇_k,   q̇_k = [J_1 q̇ = ẋ_1 ≻ ... ≻ J_k q̇ = ẋ_k ≻ min ||q̇ - q̇0||²],   each within the same limits

Every q̇_k has the bits that `solve_hierarchy` gives it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import inline
from qpsafe.compiled.memory import view
from qpsafe.hqp.own.hierarchy import HEADER
from qpsafe.hqp.own.solver import solve_compiled as solve
from qpsafe.hqp.own.state import floats_of, workspace

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_count_floats = inline(floats_of)


@inline
def solve_regime(
    floats: Array, integers: Index, m: int, matrix: Array, target: Array, last: Index, ends: Index, A: Array, b: Array,
    kept: int, closing: Array, lower: Array, upper: Array, damping: Array, x: Array, info: Index,
) -> None:  # fmt: skip
    """Solve [J_1 q̇ = ẋ_1 ≻ ... ≻ J_kept q̇ = ẋ_kept ≻ min ||q̇ - closing||²], for compiled code.

    Args:
        floats, integers, m, matrix, target, last, ends: A `Layout`.
        A, b, lower, upper, damping: As `solve_regimes` takes them.
        kept: How many tasks are.
        closing: (n,) what the last level asks for.
        x: (n,) becomes q̇; may be `closing`.
        info: (>= 3 + 2 n + rows,) zeros; becomes what `hierarchy.run` says.
    """
    n = closing.shape[0]
    count = ends[kept - 1] if kept > 0 else np.int64(0)
    rows = count + n
    for i in range(rows):
        target[i] = b[i] if i < count else closing[i - count]
        for j in range(n):
            matrix[i, j] = A[i, j] if i < count else (1.0 if j == i - count else 0.0)
    for level in range(kept):
        last[level] = ends[level]
    last[kept] = rows
    solve_levels(floats, integers, m, matrix, target, last, kept + 1, lower, upper, damping, x, info)


@inline
def solve_levels(
    floats: Array, integers: Index, m: int, matrix: Array, target: Array, last: Index, levels: int, lower: Array,
    upper: Array, damping: Array, x: Array, info: Index,
) -> None:  # fmt: skip
    """Solve equality levels that stand in `matrix`, `target` and `last` of a `Layout`; see `solve_regime`."""
    n, rows = x.shape[0], last[levels - 1]
    known = view(target, 0, (rows,))
    solve(
        view(floats, 0, (_count_floats(n, rows, m),)), integers, m, x, view(info, 0, (HEADER + n + rows,)),
        view(matrix, 0, (rows, n)), known, known, view(target, 0, (0,)), view(last, 0, (levels,)), lower, upper, False,
        view(damping, 0, (levels,)),
    )  # fmt: skip


@inline
def solve_regimes(
    floats: Array, integers: Index, m: int, matrix: Array, target: Array, last: Index, ends: Index, A: Array, b: Array,
    weights: Array, qd0: Array, lower: Array, upper: Array, damping: Array, x: Array, info: Index, qd: Array,
) -> None:  # fmt: skip
    """Solve every regime with weight, for compiled code.

    Args:
        floats, integers, m, matrix, target, last, ends: A `Layout`.
        A: (rows, n) Jacobians of all tasks, one below the other.
        b: (rows,) their velocities.
        weights: (tasks + 1,) of the regimes that keep 0, 1, ... tasks.
        qd0: (n,) evasive velocity.
        lower: (n,) lower limits.
        upper: (n,) upper limits.
        damping: (tasks + 1,) of each level, as in `solve_hierarchy`; the last one is 0.
        x: (tasks + 1, n) zeros; becomes q̇ of each regime.
        info: (tasks + 1, 3 + 2 n + rows) zeros; becomes what `hierarchy.run` says of each.
        qd: (n,) zeros; becomes the blend.
    """
    for kept in range(weights.shape[0]):
        if not weights[kept] > 0.0:
            continue
        solve_regime(
            floats, integers, m, matrix, target, last, ends, A, b, kept, qd0, lower, upper, damping, x[kept],
            view(info, kept * info.shape[1], (info.shape[1],)),
        )  # fmt: skip
        for j in range(qd.shape[0]):
            qd[j] += weights[kept] * x[kept, j]


class Layout(NamedTuple):
    """Memory for tasks of certain numbers of rows; what it holds matters during a call only."""

    floats: Array
    integers: Index
    m: int
    matrix: Array
    target: Array
    last: Index
    ends: Index


#: How many layouts are kept.
MOST_LAYOUTS = 64
_layouts: dict[tuple[int, ...], Layout] = {}


def layout_for(n: int, counts: Sequence[int], one: bool = False) -> Layout:
    """Memory for n joints and tasks of `counts` rows; kept, since a call needs it under the GIL only.

    Args:
        n: Joints.
        counts: Rows of each task.
        one: Whether all of them, and n more, will make one level.
    """
    known = _layouts.get((one, n, *counts))
    if known is not None:
        return known
    if len(_layouts) >= MOST_LAYOUTS:
        _layouts.clear()
    rows = sum(counts) + n
    m = rows if one else max(n, *counts)
    ends = np.cumsum(counts, dtype=np.int64)
    layout = Layout(
        *workspace(n, rows, m), m, np.empty((rows, n)), np.empty(rows), np.empty(len(counts) + 1, dtype=np.int64), ends
    )
    _layouts[(one, n, *counts)] = layout
    return layout
