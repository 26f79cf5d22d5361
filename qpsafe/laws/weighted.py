"""Soft priorities: all objectives in one weighted QP under the same limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import solve_hierarchy
from qpsafe.laws.problem import LawProblem, LawResult
from qpsafe.text.words import call, counted


class WeightedLaw(Fixed):
    """One QP: minimise Σ_k a_k w_k ||J_k q̇ - ẋ_k||² + w_E ||q̇ - q̇0||² within the limits.

    For two tasks: w_H m ||J_H q̇ - ẋ_H||² + w_L m f ||J_L q̇ - ẋ_L||² + w_E ||q̇ - q̇0||². Priorities are soft: a lower
    objective disturbs a higher one by about the ratio of the weights.

    Args:
        ratio: Ratio of the weights of neighbouring priorities, w_k / w_(k+1); w_E = 1.
        solver: Solver of `solve_hierarchy`; None for its default.
        weights: w_1, ..., w_N, w_E themselves, instead of the ratio; > 0.

    Raises:
        ConfigurationError: The ratio is not a finite number > 1, a weight not a finite number > 0.
    """

    fixed = frozenset(("ratio", "solver", "weights"))

    def __init__(self, ratio: float = 1e3, solver: str | None = None, weights: Sequence[float] | None = None) -> None:
        if not (math.isfinite(ratio) and ratio > 1.0):
            raise ConfigurationError("WeightedLaw", "ratio", ratio, "a finite number > 1")
        if weights is not None and not (len(weights) > 0 and all(0.0 < w < math.inf for w in weights)):
            raise ConfigurationError("WeightedLaw", "weights", weights, "finite numbers > 0: w_1, ..., w_N, w_E")
        self.ratio = ratio
        self.weights = None if weights is None else tuple(map(float, weights))
        self.solver = solver
        if solver in (None, "own"):
            import qpsafe.hqp.own.solver  # noqa: F401  compile it now if need be, not within the first tick

    def __repr__(self) -> str:
        given = {"ratio": self.ratio} if self.weights is None else {"weights": self.weights}
        return call(self, **given, solver=self.solver)

    def solve(self, problem: LawProblem) -> LawResult:
        """Solve one tick; see `LawProblem` for shapes."""
        n, count = len(problem.qd0), len(problem.tasks)
        weights = self.weights or tuple(self.ratio ** (count - k) for k in range(count + 1))
        if len(weights) != count + 1:
            raise ConfigurationError(
                "WeightedLaw", "weights", weights, f"{count + 1} of them for {counted(count, 'task')}"
            )
        closing = math.sqrt(weights[-1])
        rows, targets = [closing * np.eye(n)], [closing * problem.qd0]
        for k, ((J, xd), a) in enumerate(zip(problem.tasks, problem.activations, strict=True)):
            scale = math.sqrt(a * weights[k])  # ||s (J q̇ - ẋ)||² = s² ||J q̇ - ẋ||²
            rows.append(scale * J)
            targets.append(scale * xd)
        A, b = np.vstack(rows), np.concatenate(targets)
        solution = solve_hierarchy([*problem.soft, Level(A, b, b)], problem.lower, problem.upper, solver=self.solver)
        return LawResult(solution.qd, solution.status, ((1.0, solution),))
