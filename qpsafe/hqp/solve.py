"""`solve_hierarchy`: lexicographic least squares under hard limits, whatever the data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.hqp.level import Level, as_levels
from qpsafe.hqp.solution import INVALID_DATA, INVALID_LIMITS, ROWS_INFEASIBLE, SOLVED, STOPPED, Solution

Array = NDArray[np.float64]

DEFAULT_SOLVER = "qpsolvers:daqp"


def solve_hierarchy(
    levels: Iterable[Level | Sequence[Any]],
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    solver: str | None = None,
    *,
    rows: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
) -> Solution:
    """Solve prioritised least squares: each level is minimised among the optima of those before it.

    The hard limits `lower <= q̇ <= upper` and `rows` hold always. If freedom is left after the last level, the solution
    of smallest norm (nearest to standstill) is returned.

    Args:
        levels: `(A, b)` pairs or `Level`s, highest priority first; A is (rows, n).
        lower: (n,) hard lower limits [rad/s], may be infinite; None means none.
        upper: (n,) hard upper limits [rad/s], may be infinite; None means none.
        solver: "qpsolvers:<name>"; None means the default.
        rows: hard rows `(G, lower, upper)`: lower <= G q̇ <= upper.

    Returns:
        The solution. Bad data never raise: `status` tells, and `qd` is finite and inside the box (a joint whose own
        limits are invalid gets 0).

    Raises:
        ConfigurationError: for shapes that do not fit and unknown solvers.
    """
    begin = perf_counter()
    solver = DEFAULT_SOLVER if solver is None else solver
    backend = _backend(solver)
    stack = as_levels(levels)
    hard = None if rows is None else Level(*rows)
    n = _size(stack, hard, lower, upper)
    low, high = _limit(lower, n, "lower"), _limit(upper, n, "upper")

    def answer(qd: Array, status: str, iterations: int = 0, note: str = "") -> Solution:
        return Solution(qd, status, iterations, solver, perf_counter() - begin, stack, low, high, hard, note)

    start, box_valid = nearest_to_standstill(n, low, high)
    if not box_valid:
        return answer(start, INVALID_LIMITS)
    for k, level in enumerate(stack if hard is None else [hard, *stack]):
        if not usable(level):
            name = "rows" if hard is not None and k == 0 else f"level {k - (hard is not None)}"
            return answer(start, INVALID_DATA, note=name)

    from qpsafe.hqp.cascade import Cascade

    infinite = np.full(n, np.inf)
    cascade = Cascade(backend, start, -infinite if low is None else low, infinite if high is None else high)
    status = SOLVED
    if hard is not None:  # a level of its own on top: its least violation is zero exactly if the rows can be met
        cascade.add(hard, "rows")
        value = hard.A @ cascade.x
        if np.any(np.abs(hard.violations(cascade.x)) > 1e-8 * np.maximum(1.0, np.abs(value))):
            status = ROWS_INFEASIBLE
    for k, level in enumerate(stack):
        cascade.add(level, f"level {k}")
    if cascade.Z.shape[1]:
        cascade.add(Level(np.eye(n), np.zeros(n), np.zeros(n)), "the closing minimum norm")
    if cascade.failures:
        status = STOPPED
    return answer(cascade.x, status, cascade.iterations, "; ".join(cascade.failures))


def nearest_to_standstill(n: int, lower: Array | None, upper: Array | None) -> tuple[Array, bool]:
    """The point of the box nearest to zero, and whether the box is valid; joints without a valid interval get 0."""
    low = np.full(n, -np.inf) if lower is None else lower
    high = np.full(n, np.inf) if upper is None else upper
    valid = (low <= high) & (low < np.inf) & (high > -np.inf)  # false for NaN
    start = np.zeros(n)
    np.clip(start, low, high, out=start, where=valid)
    return start, bool(valid.all())


def usable(level: Level) -> bool:
    """Whether a level holds numbers to compute with: A finite, lower <= upper, weights positive."""
    ok = np.isfinite(level.A).all() and (level.lower <= level.upper).all()
    ok = ok and (level.lower < np.inf).all() and (level.upper > -np.inf).all()
    if level.weight is not None:
        ok = ok and (level.weight > 0.0).all() and (level.weight < np.inf).all()
    return bool(ok)


def _size(levels: list[Level], hard: Level | None, lower: ArrayLike | None, upper: ArrayLike | None) -> int:
    """Number of joints, from whatever is given."""
    if levels:
        n = levels[0].A.shape[1]
    elif hard is not None:
        n = hard.A.shape[1]
    elif lower is not None or upper is not None:
        n = int(np.size(np.asarray(lower if lower is not None else upper)))
    else:
        raise ConfigurationError("solve_hierarchy", "levels", [], "at least one level or one limit")
    if hard is not None and hard.A.shape[1] != n:
        raise ConfigurationError("solve_hierarchy", "rows[0].shape", hard.A.shape, f"(rows, {n})")
    return n


def _limit(values: ArrayLike | None, n: int, name: str) -> Array | None:
    """(n,) limit or None."""
    if values is None:
        return None
    try:
        limit = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigurationError("solve_hierarchy", name, values, f"{n} numbers [rad/s]") from None
    if limit.shape != (n,):
        raise ConfigurationError("solve_hierarchy", f"{name}.shape", limit.shape, f"({n},)")
    return limit


def _backend(solver: str) -> str:
    """Name of the qpsolvers back end behind "qpsolvers:<name>"."""
    import qpsolvers

    prefix, _, name = solver.partition(":") if isinstance(solver, str) else ("", "", "")
    if prefix != "qpsolvers" or name not in qpsolvers.available_solvers:
        known = ", ".join(f'"qpsolvers:{name}"' for name in qpsolvers.available_solvers)
        raise ConfigurationError("solve_hierarchy", "solver", solver, f"one of {known}")
    return name
