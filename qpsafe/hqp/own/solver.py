"""The own solver seen from Python: compiled once, then called with levels packed into arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled import by_reference
from qpsafe.compiled.compiled import entry, linked
from qpsafe.hqp.own import damping, hierarchy, level, linear, rules, state
from qpsafe.hqp.own.hierarchy import HEADER, run
from qpsafe.hqp.own.state import workspace
from qpsafe.hqp.packing import Packed

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def read(dimensions: int) -> Any:
    """Type of an array to read, read-only or not, so that nothing is ever compiled a second time."""
    return types.Array(types.float64, dimensions, "C", readonly=True)


_SIGNATURE = types.void(
    types.float64[::1], types.int64[::1], types.int64, types.float64[::1], types.int64[::1],
    read(2), read(1), read(1), read(1), read(1).copy(dtype=types.int64), read(1), read(1),
    types.boolean, read(1),
)  # fmt: skip


#: All the code that goes into the kernel.
MODULES = (by_reference, linear, state, damping, rules, level, hierarchy)
solve = entry(_SIGNATURE, *MODULES)(run)
solve_compiled = linked(solve, *MODULES)
"""`solve` for compiled code."""
_NO_WEIGHTS = np.empty(0)
_memory: dict[tuple[int, tuple[int, ...]], tuple[Array, Index, int, Index, Array]] = {}


def _layout(n: int, counts: tuple[int, ...]) -> tuple[Array, Index, int, Index, Array]:
    """Workspace for levels of `counts` rows; kept, because its contents matter during a call only (under the GIL)."""
    if len(_memory) >= 64:
        _memory.clear()
    m = max(n, *counts) if counts else n
    memory = (*workspace(n, sum(counts), m), m, np.cumsum(counts, dtype=np.int64), np.zeros(len(counts)))
    _memory[(n, counts)] = memory
    return memory


def solve_packed(problem: Packed, damping: Array | None = None) -> tuple[Array, Index]:
    """Solve levels packed one below the other.

    Args:
        problem: What is to be solved.
        damping: (levels,) singular values below it are damped; None for none.

    Returns:
        q̇ (n,), and `info` of `hierarchy.run`.
    """
    A, low, high, weight, counts, box_low, box_high, hard = problem
    n = box_low.shape[0]
    floats, integers, m, ends, undamped = _memory.get((n, counts)) or _layout(n, counts)
    x = np.zeros(n)
    info = np.zeros(HEADER + n + A.shape[0], np.int64)
    weights = _NO_WEIGHTS if weight is None else weight
    near = undamped if damping is None else damping
    solve(floats, integers, m, x, info, A, low, high, weights, ends, box_low, box_high, hard, near)
    return x, info
