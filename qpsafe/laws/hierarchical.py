"""The law as a blend of hierarchical QPs under hard joint limits (math section 1)."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from functools import partial
from time import perf_counter
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.activation import regime_weights
from qpsafe.errors import ConfigurationError
from qpsafe.hqp.level import Level
from qpsafe.hqp.packing import Packed
from qpsafe.hqp.solution import Solution
from qpsafe.hqp.solve import STATUS, note_of, solve_hierarchy
from qpsafe.laws.nullspace import paper_regime, pseudoinverse
from qpsafe.laws.problem import LawProblem, LawResult

Array = NDArray[np.float64]
_FLOAT = np.dtype(np.float64)

Projection = Literal["strict", "paper"]


class HierarchicalLaw:
    """Lexicographic QPs, one per regime of Table I, blended by the activations.

    q̇ = Σ_k w_k q̇_k, with w = `regime_weights` and q̇_k the solution of the hierarchy that keeps tasks 1..k,

        projection="strict":  [J_1 q̇ = ẋ_1 ≻ ... ≻ J_k q̇ = ẋ_k ≻ min ||q̇ - q̇0||²]
        projection="paper":   [J_1 q̇ = ẋ_1 ≻ min ||q̇ - (Σ_(i>=2) N_(i-1) P(J_i) ẋ_i + N_k q̇0)||²]

    each under the problem's soft levels, if any, and subject to the same limits, so the blend meets them too and is
    continuous in the activations. "paper" without active limits equals eqs. (18) and (22). "strict" differs where the
    rows of two tasks are not orthogonal: there the error of the lower one still goes to zero whenever it can. Only
    regimes with weight are solved: one in a pure regime, two in a transition.

    Args:
        projection: How tasks below the first are treated.
        solver: Solver of `solve_hierarchy`; None for its default.
        damping: Near singular poses, directions in which a task's Jacobian has a singular value below this pass
            gradually to the levels below, so that speeds stay bounded without limits too; 0.02 is a good value, 0 (off)
            is needed for equivalence. Own solver only.

    Raises:
        ConfigurationError: Unknown projection, or a damping that is no finite number >= 0.
    """

    def __init__(self, projection: Projection = "strict", solver: str | None = None, damping: float = 0.0) -> None:
        if projection not in get_args(Projection):
            raise ConfigurationError("HierarchicalLaw", "projection", projection, f"one of {get_args(Projection)}")
        if not 0.0 <= damping < math.inf:
            raise ConfigurationError("HierarchicalLaw", "damping", damping, "a finite number >= 0")
        if damping > 0.0 and solver not in (None, "own"):
            raise ConfigurationError("HierarchicalLaw", "damping", damping, f"0 with solver {solver!r}")
        self.projection = projection
        self.solver = solver
        if solver in (None, "own"):
            from qpsafe.hqp.own_regimes import solve_regimes  # compiles now if need be, not within the first tick

            self._solve_regimes = solve_regimes
        self.damping = float(damping)

    def solve(self, problem: LawProblem) -> LawResult:
        """Solve one tick; see `LawProblem` for shapes."""
        result = self._solve_together(problem) if self.solver in (None, "own") else None
        return result or self._solve_one_by_one(problem)

    def _solve_together(self, problem: LawProblem) -> LawResult | None:
        """All regimes in one compiled call, to the same bits; None where that is not possible."""
        tasks, qd0, activations, lower, upper, soft = problem
        n, above = len(qd0), (1.0, *activations)
        weights = [a - b for a, b in zip(above, (*activations, 0.0), strict=True)]  # as regime_weights
        if soft or lower is None or upper is None or not tasks or (self.projection == "paper" and any(weights[2:])):
            return None
        begin = perf_counter()
        matrices, targets = zip(*tasks, strict=True)
        A, b = np.concatenate(matrices), np.concatenate(targets)
        counts = tuple(map(len, targets))
        known = A.dtype is b.dtype is qd0.dtype is lower.dtype is upper.dtype is _FLOAT
        if not known or A.shape[1:] != (n,) or b.ndim != 1 or counts != tuple(map(len, matrices)):
            return None  # plain NumPy says what is wrong
        if not (lower.shape == upper.shape == qd0.shape and len(weights) == len(tasks) + 1):
            return None
        qd, x, info = self._solve_regimes(A, b, counts, np.array(weights), qd0, lower, upper, self.damping)
        regimes, status = [], "solved"
        heads, share = info[:, :3].tolist(), (perf_counter() - begin) / max(sum(map(bool, weights)), 1)
        for kept, weight in enumerate(weights):
            if weight > 0.0:
                code, turns, where = heads[kept]
                packed = partial(_packed, problem, A, b, counts[:kept])
                note = note_of(STATUS[code], where, packed()) if code > 1 else ""
                solution = Solution(x[kept], STATUS[code], turns, "own", share, packed, info[kept, 3:], note)
                regimes.append((weight, solution))
                if code and status == "solved":
                    status = solution.status
        return LawResult(qd, status, tuple(regimes))

    def _solve_one_by_one(self, problem: LawProblem) -> LawResult:
        """Regime by regime, by any solver."""
        qd = np.zeros(len(problem.qd0))
        status = "solved"
        regimes = []
        for kept, weight in enumerate(regime_weights(problem.activations)):
            if weight > 0.0:
                solution = self._solve_regime(problem, kept)
                qd += weight * solution.qd
                regimes.append((float(weight), solution))
                if solution.status != "solved" and status == "solved":
                    status = solution.status
        return LawResult(qd, status, tuple(regimes))

    def _solve_regime(self, problem: LawProblem, kept: int) -> Solution:
        """Solve the hierarchy that keeps the first `kept` tasks; equality levels are (A, b) pairs."""
        identity = _identity(len(problem.qd0))
        levels: list[Level | Sequence[NDArray[np.float64]]]
        if self.projection == "strict" or kept < 2:
            levels = [*problem.soft, *problem.tasks[:kept], (identity, problem.qd0)]  # E closes every hierarchy
        else:
            J_1, xd_1 = problem.tasks[0]
            # what the source adds below the first task; its part in the range of P(J_1) is overruled by level 1
            target = paper_regime(problem, kept) - pseudoinverse(J_1) @ xd_1
            levels = [*problem.soft, (J_1, xd_1), (identity, target)]
        return solve_hierarchy(levels, problem.lower, problem.upper, self.solver, damping=self.damping)


def _packed(problem: LawProblem, A: Array, b: Array, counts: tuple[int, ...]) -> Packed:
    """The hierarchy of a regime as its solution wants it to explain itself."""
    rows, n = sum(counts), len(problem.qd0)
    low = np.concatenate((b[:rows], problem.qd0))
    assert problem.lower is not None
    assert problem.upper is not None
    matrix = np.concatenate((A[:rows], _identity(n)))
    return Packed(matrix, low, low, None, [*counts, n], problem.lower, problem.upper, False)


@functools.lru_cache(maxsize=32)
def _identity(n: int) -> NDArray[np.float64]:
    identity = np.eye(n)
    identity.setflags(write=False)
    return identity
