"""The law as a blend of hierarchical QPs under hard joint limits (math section 1)."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from functools import cached_property, partial
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import inline
from qpsafe.danger.activation import regime_weights
from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.hqp.level import Level
from qpsafe.hqp.packing import Packed
from qpsafe.hqp.solution import SOLVED, Solution
from qpsafe.hqp.solve import STATUS, note_of, solve_hierarchy
from qpsafe.laws.damping import DAMPING_TIME, threshold
from qpsafe.laws.nullspace import paper_regime, pseudoinverse
from qpsafe.laws.problem import LawProblem, LawResult, TaskVelocity
from qpsafe.text.words import call

Array = NDArray[np.float64]

_NONE = np.zeros(0)

Projection = Literal["strict", "paper"]


class HierarchicalLaw(Fixed):
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
            gradually to the levels below, so that speeds stay bounded without limits too; 0.02 is a good value. Own
            solver only.
        damping_time: The same below the root of damping_time Σ K |e| over the task and those above it [s], so that the
            robot comes to rest near singular poses, with no loss where tasks are met; about ten ticks. Own solver
            only. By default 0.04 where the projection is strict and the solver the own one, else 0, off.

    Raises:
        ConfigurationError: Unknown projection, or a damping that is no finite number >= 0.
    """

    fixed = frozenset(("projection", "solver", "damping", "damping_time"))

    def __init__(
        self,
        projection: Projection = "strict",
        solver: str | None = None,
        damping: float = 0.0,
        damping_time: float | None = None,
    ) -> None:
        own = solver in (None, "own")
        if damping_time is None:
            damping_time = DAMPING_TIME if own and projection == "strict" else 0.0
        if projection not in get_args(Projection):
            raise ConfigurationError("HierarchicalLaw", "projection", projection, f"one of {get_args(Projection)}")
        for key, value in (("damping", damping), ("damping_time", damping_time)):
            if not 0.0 <= value < math.inf:
                raise ConfigurationError("HierarchicalLaw", key, value, "a finite number >= 0")
            if value > 0.0 and not own:
                raise ConfigurationError("HierarchicalLaw", key, value, f"0 with solver {solver!r}")
        self.projection = projection
        self.solver = solver
        if own:
            import qpsafe.hqp.own.solver  # noqa: F401  compile it now if need be, not within the first tick
        self.damping, self.damping_time = float(damping), float(damping_time)

    def __repr__(self) -> str:
        given = {"solver": self.solver} if self.solver is not None else {}
        return call(self, self.projection, **given, damping=self.damping, damping_time=self.damping_time)

    def solve(self, problem: LawProblem) -> LawResult:
        """Solve one tick; see `LawProblem` for shapes."""
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
            tasks: Sequence[TaskVelocity] = problem.tasks[:kept]
            levels = [*problem.soft, *tasks, (identity, problem.qd0)]  # E closes every hierarchy
        else:
            tasks = problem.tasks[:1]
            J_1, xd_1 = tasks[0]
            # what the paper adds below the first task; its part in the range of P(J_1) is overruled by level 1
            target = paper_regime(problem, kept) - pseudoinverse(J_1) @ xd_1
            levels = [*problem.soft, (J_1, xd_1), (identity, target)]
        damping, square = [0.0] * len(levels), self.damping**2
        for k in range(len(tasks)):
            correction = problem.corrections[k] if problem.corrections else _NONE
            square, damping[len(problem.soft) + k] = threshold(square, 1.0, correction, self.damping_time)
        return solve_hierarchy(levels, problem.lower, problem.upper, self.solver, damping=damping)


def weigh(activations: Any, weights: Any) -> Any:
    """Fill in and return `regime_weights`: w_k = a_k - a_(k+1), a_0 = 1, a_(N+1) = 0.

    Args:
        activations: (tasks,), a sequence or an array.
        weights: (tasks + 1,), a list or an array.
    """
    above, k = 1.0, 0
    for a in activations:
        weights[k] = above - a
        above, k = a, k + 1
    weights[k] = above
    return weights


weigh_compiled = inline(weigh)


class BlendResult(LawResult):
    """The law's answer from what [`solve_regimes`][qpsafe.hqp.own.regimes.solve_regimes] computed: the same bits.

    The regimes' solutions are made when they are looked at.

    Args:
        qd: Blend (n,).
        x: Answers of the regimes (tasks + 1, n).
        info: What the solver says about them.
        weights: Of the regimes; those without were not solved.
        data: J and ẋ of all tasks, q̇0, lower and upper limits: the solutions explain themselves with it.
        counts: Rows of each task.
        taken: Time of the call [s].
        solved: Whether all regimes were.
    """

    def __init__(
        self,
        qd: Array,
        x: Array,
        info: NDArray[np.int64],
        weights: Sequence[float],
        data: tuple[Array, Array, Array, Array, Array],
        counts: Sequence[int],
        taken: float,
        solved: bool,
    ) -> None:
        self.__dict__.update(qd=qd, status=SOLVED, _given=(x, info, weights, data, counts, taken))
        if not solved:
            bad = next(solution.status for _, solution in self.regimes if solution.status != SOLVED)
            self.__dict__["status"] = bad

    @cached_property
    def regimes(self) -> tuple[tuple[float, Solution], ...]:  # type: ignore[override]
        """(weight, solution) of every regime that was solved."""
        data: tuple[Array, Array, Array, Array, Array]
        x, info, weights, data, counts, taken = self.__dict__["_given"]
        regimes = []
        heads, share = info[:, :3].tolist(), taken / max(sum(map(bool, weights)), 1)
        for kept, weight in enumerate(weights):
            if weight > 0.0:
                code, turns, where = heads[kept]
                packed = partial(_packed, *data, counts[:kept])
                note = note_of(STATUS[code], where, packed()) if code > 1 else ""
                solution = Solution(x[kept], STATUS[code], turns, "own", share, packed, info[kept, 3:], note)
                regimes.append((weight, solution))
        return tuple(regimes)


def _packed(A: Array, b: Array, qd0: Array, lower: Array, upper: Array, counts: Sequence[int]) -> Packed:
    """The hierarchy of a regime as its solution wants it to explain itself."""
    rows, n = sum(counts), len(qd0)
    low = np.concatenate((b[:rows], qd0))
    return Packed(np.concatenate((A[:rows], _identity(n))), low, low, None, [*counts, n], lower, upper, False)


@functools.lru_cache(maxsize=32)
def _identity(n: int) -> NDArray[np.float64]:
    identity = np.eye(n)
    identity.setflags(write=False)
    return identity
