"""All regimes of a blend in one call: the own solver on the hierarchies that keep the first 0, 1, ... tasks.

    q̇ = Σ_k w_k q̇_k,   q̇_k = [J_1 q̇ = ẋ_1 ≻ ... ≻ J_k q̇ = ẋ_k ≻ min ||q̇ - q̇0||²],   each within the same limits

Every q̇_k has the bits that `solve_hierarchy` gives it. Soft levels, inequalities before the first task, stand in the
layout already: their rows on top of `matrix`, bounds and ends likewise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import inline
from qpsafe.compiled.memory import view
from qpsafe.hqp.own.hierarchy import HEADER
from qpsafe.hqp.own.solver import solve_compiled as solve
from qpsafe.hqp.own.state import floats_of, workspace

if TYPE_CHECKING:
    from qpsafe.hqp.level import Level

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_count_floats = inline(floats_of)


@inline
def solve_regime(
    floats: Array, integers: Index, m: int, matrix: Array, target: Array, last: Index, ends: Index, near: Array,
    soft: Index, A: Array, b: Array, kept: int, closing: Array, lower: Array, upper: Array, damping: Array, x: Array,
    info: Index,
) -> None:  # fmt: skip
    """Solve [soft levels ≻ J_1 q̇ = ẋ_1 ≻ ... ≻ J_kept q̇ = ẋ_kept ≻ min ||q̇ - closing||²], for compiled code.

    Args:
        floats, integers, m, matrix, target, last, ends, near, soft: A `Layout`.
        A, b, lower, upper, damping: As `solve_regimes` takes them.
        kept: How many tasks are.
        closing: (n,) what the last level asks for.
        x: (n,) becomes q̇; may be `closing`.
        info: (>= 3 + 2 n + rows,) zeros; becomes what `hierarchy.run` says.
    """
    n, levels, first = closing.shape[0], soft[0], soft[1]
    count = ends[kept - 1] if kept > 0 else np.int64(0)
    rows = count + n
    for i in range(rows):
        target[1, first + i] = b[i] if i < count else closing[i - count]
        for j in range(n):
            matrix[first + i, j] = A[i, j] if i < count else (1.0 if j == i - count else 0.0)
    for level in range(kept):
        last[levels + level] = first + ends[level]
    last[levels + kept] = first + rows
    solve_levels(
        floats, integers, m, matrix, target, last, near, soft, kept + 1, lower, upper, damping, x, info
    )  # fmt: skip


@inline
def solve_levels(
    floats: Array, integers: Index, m: int, matrix: Array, target: Array, last: Index, near: Array, soft: Index,
    levels: int, lower: Array, upper: Array, damping: Array, x: Array, info: Index,
) -> None:  # fmt: skip
    """Solve equality levels that stand in `matrix`, `target[1]` and `last` of a `Layout`, below its soft ones."""
    n, above, first = x.shape[0], soft[0], soft[1]
    every = above + levels
    rows = last[every - 1]
    high = view(target, target.shape[1], (rows,))
    low = high
    if above > 0:
        low = view(target, 0, (rows,))
        for i in range(first, rows):
            low[i] = high[i]
        for level in range(every):
            near[level] = damping[level - above] if level >= above else 0.0
        damping = near
    most = max(m, first)
    solve(
        view(floats, 0, (_count_floats(n, rows, most),)), integers, most, x, view(info, 0, (HEADER + n + rows,)),
        view(matrix, 0, (rows, n)), low, high, view(target, 0, (0,)), view(last, 0, (every,)), lower, upper, False,
        view(damping, 0, (every,)),
    )  # fmt: skip


@inline
def solve_regimes(
    floats: Array, integers: Index, m: int, matrix: Array, target: Array, last: Index, ends: Index, near: Array,
    soft: Index, A: Array, b: Array, weights: Array, qd0: Array, lower: Array, upper: Array, damping: Array, x: Array,
    info: Index, qd: Array,
) -> None:  # fmt: skip
    """Solve every regime with weight, for compiled code.

    Args:
        floats, integers, m, matrix, target, last, ends, near, soft: A `Layout`.
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
            floats, integers, m, matrix, target, last, ends, near, soft, A, b, kept, qd0, lower, upper, damping,
            x[kept], view(info, kept * info.shape[1], (info.shape[1],)),
        )  # fmt: skip
        for j in range(qd.shape[0]):
            qd[j] += weights[kept] * x[kept, j]


class Layout(NamedTuple):
    """Memory for tasks of certain numbers of rows; what it holds matters during a call only.

    Attributes:
        floats, integers: Workspace of the solver.
        m: Rows of the largest task or level of the identity.
        matrix: (rows, n) of all levels, soft ones first.
        target: (2, rows) lower and upper bounds; of equalities the upper ones.
        last: After the last row of each level.
        ends: Likewise of the tasks alone.
        near: Damping of each level.
        soft: How many soft levels there are, rows of them, and how many of these, the first ones, tasks give way to.
    """

    floats: Array
    integers: Index
    m: int
    matrix: Array
    target: Array
    last: Index
    ends: Index
    near: Array
    soft: Index

    def fill(self, levels: Sequence[Level]) -> None:
        """Write down the soft levels, of which there is room for `MOST_SOFT`."""
        first = firm = 0
        for k, level in enumerate(levels):
            stop = first + level.rows
            firm = stop if level.firm and firm == first else firm
            self.matrix[first:stop], self.target[0, first:stop], self.target[1, first:stop] = (
                level.A, level.lower, level.upper,
            )  # fmt: skip
            first = self.last[k] = stop
        self.soft[0], self.soft[1], self.soft[2] = len(levels), first, firm


#: How many layouts are kept.
MOST_LAYOUTS = 64
MOST_SOFT = 4
_layouts: dict[tuple[int, ...], Layout] = {}


def layout_for(n: int, counts: Sequence[int], one: bool = False, room: int = 0) -> Layout:
    """Memory for n joints and tasks of `counts` rows; kept, since a call needs it under the GIL only.

    Args:
        n: Joints.
        counts: Rows of each task.
        one: Whether all of them, and n more, will make one level.
        room: For rows of soft levels, which `fill` writes down.
    """
    known = _layouts.get((one, room, n, *counts))
    if known is not None:
        return known
    if len(_layouts) >= MOST_LAYOUTS:
        _layouts.clear()
    rows = sum(counts) + n
    m = rows if one else max(n, *counts)
    levels, rows = len(counts) + 1 + (MOST_SOFT if room else 0), rows + room
    layout = Layout(
        *workspace(n, rows, max(m, room)), m, np.empty((rows, n)), np.empty((2, rows)),
        np.empty(levels, dtype=np.int64), np.cumsum(counts, dtype=np.int64), np.empty(levels),
        np.zeros(3, dtype=np.int64),
    )  # fmt: skip
    _layouts[(one, room, n, *counts)] = layout
    return layout
