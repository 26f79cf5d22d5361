"""All regimes of a blend in one call: the own solver on the hierarchies that keep the first 0, 1, ... tasks.

    q̇ = Σ_k w_k q̇_k,   q̇_k = [J_1 q̇ = ẋ_1 ≻ ... ≻ J_k q̇ = ẋ_k ≻ min ||q̇ - q̇0||²],   each within the same limits

Every q̇_k has the bits that `solve_hierarchy` gives it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.hqp.own_hierarchy import HEADER
from qpsafe.hqp.own_linear import OPTIONS, jit
from qpsafe.hqp.own_solver import SOURCES, read, solve
from qpsafe.hqp.own_state import floats_of, workspace

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_count_floats = jit(floats_of)
_ints = read(1).copy(dtype=types.int64)
_SIGNATURE = types.void(
    types.float64[::1], types.int64[::1], types.int64, types.float64[:, ::1], types.float64[::1], types.int64[::1],
    _ints, read(2), read(1), read(1), read(1), read(1), read(1), types.float64,
    types.float64[:, ::1], types.int64[:, ::1], types.float64[::1],
)  # fmt: skip


def _compile(key: int) -> Callable[..., None]:
    """Compile, or load from the cache; the key tells the state of the solver's sources."""

    def solve_all(  # type: ignore[no-untyped-def]
        floats, integers, m, matrix, target, last, ends, A, b, weights, qd0, lower, upper, damping, x, info, qd
    ):
        n = qd0.shape[0]
        for kept in range(weights.shape[0]):
            if not weights[kept] > 0.0 or key < 0:
                continue
            # tasks 1..kept, and q̇ = q̇0, which closes every hierarchy
            count = ends[kept - 1] if kept > 0 else np.int64(0)
            rows = count + n
            for i in range(rows):
                target[i] = b[i] if i < count else qd0[i - count]
                for j in range(n):
                    matrix[i, j] = A[i, j] if i < count else (1.0 if j == i - count else 0.0)
            for level in range(kept):
                last[level] = ends[level]
            last[kept] = rows
            known = target[:rows]
            solve(
                floats[: _count_floats(n, rows, m)], integers, m, x[kept], info[kept, : HEADER + n + rows],
                matrix[:rows], known, known, target[:0], last[: kept + 1], lower, upper, False, damping,
            )  # fmt: skip
            for j in range(n):
                qd[j] += weights[kept] * x[kept, j]

    try:
        return numba.njit(_SIGNATURE, cache=True, **OPTIONS)(solve_all)
    except RuntimeError:  # no directory that numba may write to
        return numba.njit(_SIGNATURE, **OPTIONS)(solve_all)


_solve_all = _compile(SOURCES)


class Layout(NamedTuple):
    """Memory for tasks of certain numbers of rows; what it holds matters during a call only."""

    floats: Array
    integers: Index
    m: int
    matrix: Array
    target: Array
    last: Index
    ends: Index


_layouts: dict[tuple[int, ...], Layout] = {}


def _layout(n: int, counts: Sequence[int]) -> Layout:
    if len(_layouts) >= 64:
        _layouts.clear()
    m, rows = max(n, *counts), sum(counts) + n
    ends = np.cumsum(counts, dtype=np.int64)
    layout = Layout(
        *workspace(n, rows, m), m, np.empty((rows, n)), np.empty(rows), np.empty(len(counts) + 1, dtype=np.int64), ends
    )
    _layouts[(n, *counts)] = layout
    return layout


def solve_regimes(
    A: Array, b: Array, counts: Sequence[int], weights: Array, qd0: Array, lower: Array, upper: Array, damping: float
) -> tuple[Array, Array, Index]:
    """Solve every regime with weight.

    Args:
        A: (rows, n) Jacobians of all tasks, one below the other.
        b: (rows,) their velocities.
        counts: Rows of each task.
        weights: (tasks + 1,) of the regimes that keep 0, 1, ... tasks.
        qd0: (n,) evasive velocity.
        lower: (n,) lower limits.
        upper: (n,) upper limits.
        damping: As in `solve_hierarchy`.

    Returns:
        The blend (n,); per regime q̇ (tasks + 1, n), and `info` of [`own_hierarchy.run`][qpsafe.hqp.own_hierarchy.run]
        (only its first 3 + n + rows numbers).
    """
    n = len(qd0)
    memory = _layouts.get((n, *counts)) or _layout(n, counts)
    x = np.zeros((len(weights), n))
    info = np.zeros((len(weights), HEADER + n + len(memory.target)), np.int64)
    qd = np.zeros(n)
    _solve_all(*memory, A, b, weights, qd0, lower, upper, damping, x, info, qd)
    return qd, x, info
