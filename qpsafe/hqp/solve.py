"""`solve_hierarchy`: lexicographic least squares under hard limits, whatever the data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.hqp.level import Level, as_levels
from qpsafe.hqp.solution import (
    FAILED,
    INEXACT,
    INVALID_DATA,
    INVALID_LIMITS,
    ROWS_INFEASIBLE,
    SOLVED,
    STOPPED,
    Packed,
    Solution,
)

Array = NDArray[np.float64]

_FLOAT = np.dtype(np.float64)
_STATUS = (SOLVED, ROWS_INFEASIBLE, STOPPED, INVALID_DATA, INVALID_LIMITS, INEXACT, FAILED)  # codes of own_hierarchy
_solve_packed: Callable[..., tuple[Array, NDArray[np.int64]]] | None = None


def solve_hierarchy(
    levels: Iterable[Level | Sequence[Any]],
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    solver: str | None = None,
    *,
    rows: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    damping: float = 0.0,
) -> Solution:
    """Solve prioritised least squares: each level is minimised among the optima of those before it.

    The hard limits `lower <= q̇ <= upper` and `rows` hold always. If freedom is left after the last level, the solution
    of smallest norm (nearest to standstill) is returned.

    Args:
        levels: `(A, b)` pairs or `Level`s, highest priority first; A is (rows, n).
        lower: (n,) hard lower limits [rad/s], may be infinite; None means none.
        upper: (n,) hard upper limits [rad/s], may be infinite; None means none.
        solver: "own" (the default) or "qpsolvers:<name>". Where a back end fails, the own solver answers, and
            `solver` and `note` of the solution say so.
        rows: hard rows `(G, lower, upper)`: lower <= G q̇ <= upper.
        damping: near a singular pose, directions in which an equality level has a singular value below this (unit of
            A) pass gradually to the levels below, so that q̇ stays bounded and continuous; levels above notice
            nothing. 0 means none. Own solver only.

    Returns:
        The solution. Bad data never raise: `status` tells, and `qd` is finite and inside the box (a joint whose own
        limits are invalid gets 0).

    Raises:
        ConfigurationError: for shapes that do not fit and unknown solvers.
    """
    begin = perf_counter()
    problem = _pack(levels, lower, upper, rows)
    if not 0.0 <= damping < np.inf:
        raise ConfigurationError("solve_hierarchy", "damping", damping, "a number >= 0, in the unit of A")
    if solver is None or solver == "own":
        return _own(problem, begin, damping)
    if damping > 0.0:
        raise ConfigurationError("solve_hierarchy", "damping", damping, f'0 with solver {solver!r}; only "own" damps')
    return _cascade(problem, solver, begin)


def _own(problem: Packed, begin: float, damping: float = 0.0, note: str = "") -> Solution:
    """Solve with the own solver."""
    global _solve_packed
    if _solve_packed is None:  # the first use: it brings numba
        from qpsafe.hqp.own_solver import solve_packed

        _solve_packed = solve_packed
    qd, info = _solve_packed(*problem, damping)
    code, turns, where = info[:3].tolist()
    status = _STATUS[code]
    if code > 1 and not note:
        note = f"row {where}" if status == INEXACT else _name(problem, where)
    return Solution(qd, status, turns, "own", perf_counter() - begin, problem, info[3:], note)


def _cascade(problem: Packed, solver: str, begin: float) -> Solution:
    """Solve level by level with a back end of qpsolvers."""
    from qpsafe.hqp.cascade import solve_cascade

    backend = _backend(solver)
    start, box_valid = nearest_to_standstill(problem.box_low, problem.box_high)
    levels = _unpack(problem)
    bad = next((k for k, level in enumerate(levels) if not usable(level)), None)
    if not box_valid or bad is not None:
        status, note = (INVALID_LIMITS, "") if not box_valid else (INVALID_DATA, _name(problem, bad or 0))
        return Solution(start, status, 0, solver, perf_counter() - begin, problem, None, note)
    qd, turns, failures = solve_cascade(backend, levels, start, problem.box_low, problem.box_high)
    if failures:
        return _own(problem, begin, note=f"{solver} failed at {_name(problem, failures[0])}, the own solver answered")
    solution = Solution(qd, SOLVED, turns, solver, perf_counter() - begin, problem)
    if problem.hard and levels[0].rows:
        value = levels[0].A @ qd
        if np.any(np.abs(levels[0].violations(qd)) > 1e-8 * np.maximum(1.0, np.abs(value))):
            solution.status = ROWS_INFEASIBLE
    return solution


def _pack(
    levels: Iterable[Level | Sequence[Any]],
    lower: ArrayLike | None,
    upper: ArrayLike | None,
    rows: tuple[ArrayLike, ArrayLike, ArrayLike] | None,
) -> Packed:
    """Copy the problem into arrays: whole lists at once where all is plain, through `as_levels` where it is not."""
    if type(levels) is not list:
        levels = list(levels)
    if rows is not None:
        levels = [Level(*rows), *as_levels(levels)]
    if not levels:
        return _without_levels(lower, upper)
    matrices: Sequence[Array]
    try:
        matrices, lows = zip(*levels, strict=True)  # type: ignore[arg-type]  # plain pairs (A, b)
        matrix, low = np.concatenate(matrices), np.concatenate(lows)
        counts = list(map(len, matrices))
        plain = matrix.dtype is low.dtype is _FLOAT and counts == list(map(len, lows))
        plain = plain and matrix.ndim == 2 and low.ndim == 1
    except (TypeError, ValueError):  # Levels among them, rows given as vectors, or mistakes
        plain = False
    weight = None
    if plain:
        high = low
    else:
        stack = as_levels(levels)
        counts = [level.A.shape[0] for level in stack]
        matrix = np.concatenate([level.A for level in stack])
        low = high = np.concatenate([level.lower for level in stack])
        if any(level.lower is not level.upper for level in stack):
            high = np.concatenate([level.upper for level in stack])
        if any(level.weight is not None for level in stack):
            weight = np.concatenate([np.ones(len(x.A)) if x.weight is None else x.weight for x in stack])
    if not matrix.flags.c_contiguous:
        matrix = np.ascontiguousarray(matrix)
    n = matrix.shape[1]
    if n == 0:
        raise ConfigurationError("solve_hierarchy", "levels[0].A.shape", matrix.shape, "(rows, n) with n >= 1")
    box_low = np.full(n, -np.inf) if lower is None else _limit(lower, n, "lower")
    box_high = np.full(n, np.inf) if upper is None else _limit(upper, n, "upper")
    return Packed(matrix, low, high, weight, counts, box_low, box_high, rows is not None)


def _without_levels(lower: ArrayLike | None, upper: ArrayLike | None) -> Packed:
    """A problem of limits alone."""
    n = int(np.size(np.asarray(upper if lower is None else lower)))
    if lower is None and upper is None:
        raise ConfigurationError("solve_hierarchy", "levels", [], "at least one level or one limit")
    box_low = np.full(n, -np.inf) if lower is None else _limit(lower, n, "lower")
    box_high = np.full(n, np.inf) if upper is None else _limit(upper, n, "upper")
    return Packed(np.empty((0, n)), np.empty(0), np.empty(0), None, [], box_low, box_high, False)


def _unpack(problem: Packed) -> list[Level]:
    """The levels of a packed problem, hard rows first."""
    levels, first = [], 0
    for count in problem.counts:
        part = slice(first, first + count)
        weight = None if problem.weight is None else problem.weight[part]
        levels.append(Level(problem.A[part], problem.low[part], problem.high[part], weight))
        first += count
    return levels


def _name(problem: Packed, level: int) -> str:
    """What a person calls a level of a packed problem."""
    level -= problem.hard
    if level == len(problem.counts) - problem.hard:
        return "the closing smallest norm"
    return "the hard rows" if level < 0 else f"level {level}"


def nearest_to_standstill(lower: Array, upper: Array) -> tuple[Array, bool]:
    """The point of the box nearest to zero, and whether the box is valid; joints without a valid interval get 0."""
    valid = (lower <= upper) & (lower < np.inf) & (upper > -np.inf)  # false for NaN
    start = np.zeros(lower.shape[0])
    np.clip(start, lower, upper, out=start, where=valid)
    return start, bool(valid.all())


def usable(level: Level) -> bool:
    """Whether a level holds numbers to compute with: A finite, lower <= upper, weights positive."""
    ok = np.isfinite(level.A).all() and (level.lower <= level.upper).all()
    ok = ok and (level.lower < np.inf).all() and (level.upper > -np.inf).all()
    if level.weight is not None:
        ok = ok and (level.weight > 0.0).all() and (level.weight < np.inf).all()
    return bool(ok)


def _limit(values: ArrayLike, n: int, name: str) -> Array:
    """(n,) limit, copied."""
    try:
        limit = np.array(values, _FLOAT)
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
        raise ConfigurationError("solve_hierarchy", "solver", solver, f'"own" or one of {known}')
    return name
