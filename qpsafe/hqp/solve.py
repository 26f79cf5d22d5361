"""`solve_hierarchy`: lexicographic least squares under hard limits, whatever the data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.extras import require
from qpsafe.hqp.level import Level
from qpsafe.hqp.packing import Packed, pack, unpack
from qpsafe.hqp.solution import (
    FAILED,
    ILL_CONDITIONED,
    INEXACT,
    INVALID_DATA,
    INVALID_LIMITS,
    ROWS_INFEASIBLE,
    SOLVED,
    STOPPED,
    Solution,
)
from qpsafe.text.given import numbers
from qpsafe.text.words import counted

Array = NDArray[np.float64]

STATUS = (
    SOLVED,
    ROWS_INFEASIBLE,
    STOPPED,
    INVALID_DATA,
    INVALID_LIMITS,
    INEXACT,
    FAILED,
    ILL_CONDITIONED,
)  # hierarchy
_EPSILON = "a number >= 0 in the unit of A, or one for each level"
WORSE = 1e-8  # an answer whose level is worse than the judge's by more than this, relative above 1, is not returned
_solve_packed: Callable[..., tuple[Array, NDArray[np.int64]]] | None = None


def solve_hierarchy(
    levels: Iterable[Level | Sequence[Any]],
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    solver: str | None = None,
    *,
    rows: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    damping: float | Sequence[float] = 0.0,
) -> Solution:
    """Solve prioritised least squares: each level is minimised among the optima of those before it.

    The hard limits `lower <= q̇ <= upper` and `rows` hold always. If freedom is left after the last level, the solution
    of smallest norm (nearest to standstill) is returned.

    Args:
        levels: `(A, b)` pairs or `Level`s, highest priority first; A is (rows, n).
        lower: (n,) hard lower limits [rad/s], may be infinite; None means none.
        upper: (n,) hard upper limits [rad/s], may be infinite; None means none.
        solver: "own" (the default), "daqp" (its hierarchical mode), "proxqp" (level by level in workspaces that are
            kept and warm started) or "qpsolvers:<name>" (one program per level). The built-in solver judges these:
            where they fail or a level comes out worse, its answer is returned, and `solver` and `note` say so.
        rows: hard rows `(G, lower, upper)`: lower <= G q̇ <= upper. They have no weights.
        damping: near a singular pose, directions in which an equality level has a singular value below this (unit of
            A) pass gradually to the levels below, so that q̇ stays bounded and continuous; levels above notice
            nothing. One number, or one per level; 0 means none. Own solver only.

    Returns:
        The solution. "solved" means optimal at every level to rounding, in any units of levels and hard rows; where
        rows of one level are so different in size that rounding decides, the status is "ill-conditioned" (figures:
        docs/explanation/hierarchical-qp.md). Bad data never raise: `status` tells, and `qd` is finite and inside the
        box (a joint whose own limits are invalid gets 0). Numbers beyond 1e60 count as infinite.

    Raises:
        ConfigurationError: for shapes that do not fit, anything but real numbers, and unknown solvers.
    """
    begin = perf_counter()
    problem = pack(levels, lower, upper, rows)
    near = None if type(damping) is float and damping == 0.0 else _damping(damping, problem)
    if solver is None or (isinstance(solver, str) and solver == "own"):
        return _own(problem, begin, near)
    if near is not None:
        raise ConfigurationError("solve_hierarchy", "damping", damping, f'0 with solver {solver!r}; only "own" damps')
    return _by_back_end(problem, solver, begin)


def _damping(damping: float | Sequence[float], problem: Packed) -> Array | None:
    """ε of every level, hard rows first, which have none; None if all are 0."""
    hard = int(problem.hard)
    levels = len(problem.counts) - hard
    if type(damping) is float or (type(damping) is list and set(map(type, damping)) == {float}):
        values = np.array(damping)
    else:
        values = numbers("solve_hierarchy", "damping", damping, _EPSILON)
    if values.shape not in ((), (levels,)) or not np.all((values >= 0.0) & (values < np.inf)):
        expected = f"{_EPSILON}, here {counted(levels, 'level')}"
        raise ConfigurationError("solve_hierarchy", "damping", damping, expected)
    if not values.any():
        return None
    near = np.zeros(levels + hard)
    near[hard:] = values
    return near


def require_solver(solver: str | None, where: str = "solve_hierarchy") -> str:
    """The back end of qpsolvers behind a solver, empty for the others; what is no solver is refused at once.

    Args:
        solver: As given.
        where: Who asks, for the error.

    Raises:
        ConfigurationError: There is none of this name.
        MissingExtraError: It is not installed; names the extra that brings it.
    """
    if solver is None or (isinstance(solver, str) and solver in ("own", "daqp", "proxqp")):
        if solver == "proxqp":
            require("proxqp", 'solver = "proxqp"', "proxsuite")
        return ""
    import qpsolvers

    prefix, _, name = solver.partition(":") if isinstance(solver, str) else ("", "", "")
    if prefix != "qpsolvers" or name not in qpsolvers.available_solvers:
        known = ", ".join(f'"qpsolvers:{name}"' for name in qpsolvers.available_solvers)
        raise ConfigurationError(where, "solver", solver, f'"own", "daqp", "proxqp" or one of {known}')
    return name


def _own(problem: Packed, begin: float, damping: Array | None = None, note: str = "") -> Solution:
    """Solve with the own solver."""
    global _solve_packed
    if _solve_packed is None:  # the first use: it brings numba
        from qpsafe.hqp.own.solver import solve_packed

        _solve_packed, begin = solve_packed, perf_counter()
    qd, info = _solve_packed(problem, damping)
    code, turns, where = info[:3].tolist()
    status = STATUS[code]
    if code > 1 and not note:
        note = note_of(status, where, problem)
    return Solution(qd, status, turns, "own", perf_counter() - begin, problem, info[3:], note)


def note_of(status: str, where: int, problem: Packed) -> str:
    """Where a status other than the good ones comes from.

    Args:
        status: Any but the good ones.
        where: The row or the level concerned.
        problem: What was to be solved.
    """
    return f"row {where}" if status == INEXACT else _name(problem, where)


def _by_back_end(problem: Packed, solver: str, begin: float) -> Solution:
    """Solve with somebody else's solver; the own one judges the result, and answers where it fails."""
    backend = require_solver(solver)
    own = _own(problem, begin)
    if own.status in (INVALID_DATA, INVALID_LIMITS, FAILED):
        return own
    levels, box = unpack(problem), (problem.box_low, problem.box_high)
    qd: Array | None
    failures: list[int] = []
    if backend:
        from qpsafe.hqp.backends.cascade import solve_cascade

        qd, turns, failures = solve_cascade(backend, levels, np.clip(np.zeros_like(box[0]), *box), *box)
    elif solver == "proxqp":
        from qpsafe.hqp.backends.native_proxqp import solve_proxqp

        qd, turns, failures = solve_proxqp(levels, *box)
    else:
        from qpsafe.hqp.backends.native_daqp import solve_daqp

        qd, turns = solve_daqp(levels, *box, problem.hard)
    if qd is None or failures:
        own.note = f"{solver} failed{f' at {_name(problem, failures[0])}' if failures else ''}, the own solver answered"
        return own
    solution = Solution(qd, own.status, turns, solver, perf_counter() - begin, problem)
    worse = _worse_level((*solution.costs, _norm(qd)), (*own.costs, _norm(own.qd)))
    if worse is not None:
        own.note = f"{solver} was worse at {_name(problem, worse)}, the own solver answered"
        return own
    return solution


def _norm(qd: Array) -> float:
    """What is minimised after the last level."""
    return float(np.sqrt(qd @ qd))


def _worse_level(costs: Sequence[float], judge: Sequence[float]) -> int | None:
    """The first level at which the costs are lexicographically worse than the judge's, None if they are not."""
    for k, (theirs, ours) in enumerate(zip(costs, judge, strict=True)):
        tolerance = WORSE * max(1.0, ours)
        if not theirs <= ours + tolerance:
            return k
        if theirs < ours - tolerance:
            return None
    return None


def _name(problem: Packed, level: int) -> str:
    """What a person calls a level of a packed problem."""
    level -= problem.hard
    if level == len(problem.counts) - problem.hard:
        return "the closing smallest norm"
    return "the hard rows" if level < 0 else f"level {level}"
