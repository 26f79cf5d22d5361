"""The law as a blend of hierarchical QPs under hard joint limits (derivations, section 1)."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import inline
from qpsafe.danger.activation import regime_weights
from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.hqp.level import Level
from qpsafe.hqp.solution import Solution
from qpsafe.hqp.solve import require_solver, solve_hierarchy
from qpsafe.laws.damping import DAMPING_TIME, MOST, threshold
from qpsafe.laws.problem import LawProblem, LawResult, TaskVelocity
from qpsafe.text.given import number, one_of
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
        ConfigurationError: Unknown projection or solver, or a damping that is not a finite number >= 0.
    """

    fixed = frozenset(("projection", "solver", "damping", "damping_time"))

    def __init__(
        self,
        projection: Projection = "strict",
        solver: str | None = None,
        damping: float = 0.0,
        damping_time: float | None = None,
    ) -> None:
        require_solver(solver, "HierarchicalLaw")
        one_of("HierarchicalLaw", "projection", projection, get_args(Projection))
        own = solver in (None, "own")
        if damping_time is None:
            damping_time = DAMPING_TIME if own and projection == "strict" else 0.0
        expected = f"a finite number >= 0, up to {MOST:g}"
        for key, value in (("damping", damping), ("damping_time", damping_time)):
            if number("HierarchicalLaw", key, value, expected, 0.0, most=MOST) > 0.0 and not own:
                raise ConfigurationError("HierarchicalLaw", key, value, f"0 with solver {solver!r}")
        self.projection = projection
        self.solver = solver
        # compile now if need be, not within the first tick
        if own:
            import qpsafe.hqp.own.solver
        if projection == "paper":
            import qpsafe.laws.projections  # noqa: F401
        self.damping, self.damping_time = float(damping), float(damping_time)

    def __repr__(self) -> str:
        given = {"solver": self.solver} if self.solver is not None else {}
        return call(self, self.projection, **given, damping=self.damping, damping_time=self.damping_time)

    def solve(self, problem: LawProblem) -> LawResult:
        """Solve one tick; see `LawProblem` for shapes."""
        qd = np.zeros(len(problem.qd0))
        status = "solved"
        regimes = []
        weights = regime_weights(problem.activations)
        closing = self._closing(problem, int(np.flatnonzero(weights)[-1]))
        for kept, weight in enumerate(weights):
            if weight > 0.0:
                solution = self._solve_regime(problem, kept, closing[kept])
                qd += weight * solution.qd
                regimes.append((float(weight), solution))
                if solution.status != "solved" and status == "solved":
                    status = solution.status
        return LawResult(qd, status, tuple(regimes))

    def _closing(self, problem: LawProblem, most: int) -> Sequence[Array]:
        """What the last level of each regime asks for: q̇0, or what the paper adds below the first task."""
        if self.projection == "strict" or most < 2:
            return [problem.qd0] * (most + 1)
        from qpsafe.laws.projections import regimes_of

        # without N_0 P(J_1) ẋ_1: what lies in the range of P(J_1) is overruled by level 1
        return [problem.qd0, problem.qd0, *regimes_of(problem.tasks[:most], problem.qd0, spared=1)[2:]]

    def _solve_regime(self, problem: LawProblem, kept: int, closing: Array) -> Solution:
        """Solve the hierarchy that keeps the first `kept` tasks; equality levels are (A, b) pairs."""
        tasks: Sequence[TaskVelocity] = problem.tasks[: kept if self.projection == "strict" else min(kept, 1)]
        levels: list[Level | Sequence[NDArray[np.float64]]]
        levels = [*problem.soft, *tasks, (_identity(len(closing)), closing)]  # E closes every hierarchy
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


@functools.lru_cache(maxsize=32)
def _identity(n: int) -> NDArray[np.float64]:
    identity = np.eye(n)
    identity.setflags(write=False)
    return identity
