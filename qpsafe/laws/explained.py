"""Results of compiled ticks in the form that the law's own `solve` returns, made only when somebody looks at them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.hqp.packing import Packed
from qpsafe.hqp.solution import SOLVED, Solution
from qpsafe.hqp.solve import STATUS, note_of
from qpsafe.laws.kinds import NULLSPACE, PAPER, WEIGHTED
from qpsafe.laws.problem import LawResult
from qpsafe.laws.weighted import into_one

if TYPE_CHECKING:
    from qpsafe.hqp.level import Level

Array = NDArray[np.float64]


class Solved(NamedTuple):
    """Contents of a compiled tick's blocks after the law has answered.

    Attributes:
        A: Jacobians of the tasks (rows, n).
        b: Their velocities (rows,).
        qd0: Evasive velocity (n,).
        lower: Limits (n,).
        upper: Limits (n,).
        qd: The law's q̇ (n,).
        x: Answers of the solver (tasks + 1, n).
        info: What it says about them.
        weights: Of the regimes; those without weight were not solved.
        counts: Rows of each task.
        taken: Time of the call [s].
        soft: Levels above the tasks.
    """

    A: Array
    b: Array
    qd0: Array
    lower: Array
    upper: Array
    qd: Array
    x: Array
    info: NDArray[np.int64]
    weights: Sequence[float]
    counts: Sequence[int]
    taken: float
    soft: tuple[Level, ...] = ()


def explain(s: Solved, solved: bool, kind: int, importance: Array, activations: Sequence[float]) -> LawResult:
    """The law's answer.

    Args:
        s: Contents of the tick's blocks.
        solved: Whether every regime was solved.
        kind: Of the law, see `kinds`.
        importance: w_1, ..., w_N, w_E of a weighted one.
        activations: (tasks,).
    """
    if kind == NULLSPACE:
        return LawResult(s.qd)
    if kind == WEIGHTED:
        return BlendResult(s, solved, [1.0], partial(weighted_level, s, importance, activations))
    return BlendResult(s, solved, s.weights, partial(paper_hierarchy if kind == PAPER else hierarchy, s))


class BlendResult(LawResult):
    """A blend of solutions, each made only when somebody looks at it: the same bits as those of `solve_hierarchy`.

    Args:
        s: Contents of the tick's blocks.
        solved: Whether every regime was solved.
        weights: Of the regimes.
        packed: Makes the problem of a regime, by number.
    """

    def __init__(self, s: Solved, solved: bool, weights: Sequence[float], packed: Callable[[int], Packed]) -> None:
        self.__dict__.update(qd=s.qd, status=SOLVED, _given=(s, weights, packed))
        if not solved:
            bad = next(solution.status for _, solution in self.regimes if solution.status != SOLVED)
            self.__dict__["status"] = bad

    @cached_property
    def regimes(self) -> tuple[tuple[float, Solution], ...]:  # type: ignore[override]
        """(weight, solution) of every regime that was solved."""
        s: Solved
        s, weights, packed = self.__dict__["_given"]
        regimes = []
        heads, share = s.info[:, :3].tolist(), s.taken / max(sum(map(bool, weights)), 1)
        for kept, weight in enumerate(weights):
            if weight > 0.0:
                code, turns, where = heads[kept]
                problem = partial(packed, kept)
                note = note_of(STATUS[code], where, problem()) if code > 1 else ""
                solution = Solution(s.x[kept], STATUS[code], turns, "own", share, problem, s.info[kept, 3:], note)
                regimes.append((weight, solution))
        return tuple(regimes)


def hierarchy(s: Solved, kept: int, closing: Array | None = None) -> Packed:
    """[J_1 q̇ = ẋ_1 ≻ ... ≻ J_kept q̇ = ẋ_kept ≻ q̇ = closing].

    Args:
        s: Contents of the tick's blocks.
        kept: How many tasks are kept.
        closing: q̇0 if None.
    """
    counts, n = s.counts[:kept], len(s.qd0)
    rows = sum(counts)
    target = np.concatenate((s.b[:rows], s.qd0 if closing is None else closing))
    return under(s, np.concatenate((s.A[:rows], np.eye(n))), target, [*counts, n])


def under(s: Solved, A: Array, target: Array, counts: list[int]) -> Packed:
    """Equality levels below the soft ones.

    Args:
        s: Contents of the tick's blocks.
        A: (rows, n).
        target: (rows,).
        counts: Rows of each.
    """
    if not s.soft:
        return Packed(A, target, target, None, tuple(counts), s.lower, s.upper, False)
    low = np.concatenate([*(level.lower for level in s.soft), target])
    high = np.concatenate([*(level.upper for level in s.soft), target])
    A = np.concatenate([*(level.A for level in s.soft), A])
    return Packed(A, low, high, None, (*(level.rows for level in s.soft), *counts), s.lower, s.upper, False)


def paper_hierarchy(s: Solved, kept: int) -> Packed:
    """[J_1 q̇ = ẋ_1 ≻ q̇ = what the paper adds below], for two tasks and more.

    Args:
        s: Contents of the tick's blocks.
        kept: How many tasks are kept.
    """
    if kept < 2:
        return hierarchy(s, kept)
    from qpsafe.laws.projections import regimes_of

    tasks = [(s.A[a:b], s.b[a:b]) for a, b in pairwise([0, *accumulate(s.counts[:kept])])]
    return hierarchy(s, 1, regimes_of(tasks, s.qd0, spared=1)[kept])


def weighted_level(s: Solved, importance: Array, activations: Sequence[float], kept: int) -> Packed:
    """The weighted sum as one level.

    Args:
        s: Contents of the tick's blocks.
        importance: w_1, ..., w_N, w_E.
        activations: (tasks,).
        kept: Always 0: there is one problem.
    """
    rows, n = len(s.b) + len(s.qd0), len(s.qd0)
    matrix, target = np.empty((rows, n)), np.empty(rows)
    into_one(s.A, s.b, list(accumulate(s.counts)), s.qd0, activations, importance, matrix, target)
    return under(s, matrix, target, [rows])
