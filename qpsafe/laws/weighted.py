"""Soft priorities: all objectives in one weighted QP under the same limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import inline
from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import require_solver, solve_hierarchy
from qpsafe.laws.problem import LawProblem, LawResult
from qpsafe.text.given import number, numbers
from qpsafe.text.words import call, counted

Array = NDArray[np.float64]

#: Weights beyond it, or below its reciprocal, leave the solver nothing to weigh.
HEAVIEST = 1e100


class WeightedLaw(Fixed):
    """One QP: minimise Σ_k a_k w_k ||J_k q̇ - ẋ_k||² + w_E ||q̇ - q̇0||² within the limits.

    For two tasks: w_H m ||J_H q̇ - ẋ_H||² + w_L m f ||J_L q̇ - ẋ_L||² + w_E ||q̇ - q̇0||². Priorities are soft: a lower
    objective disturbs a higher one by about the ratio of the weights.

    Args:
        ratio: Ratio of the weights of neighbouring priorities, w_k / w_(k+1); w_E = 1.
        solver: Solver of `solve_hierarchy`; None for its default.
        weights: w_1, ..., w_N, w_E themselves, instead of the ratio; > 0.

    Raises:
        ConfigurationError: The ratio is not a number > 1, a weight not a number > 0, or it is beyond `HEAVIEST`; or
            there is no such solver.
    """

    fixed = frozenset(("ratio", "solver", "weights"))

    def __init__(self, ratio: float = 1e3, solver: str | None = None, weights: Sequence[float] | None = None) -> None:
        expected = f"a number > 1, up to {HEAVIEST:g}"
        self.ratio = number("WeightedLaw", "ratio", ratio, expected, above=1.0, most=HEAVIEST)
        self.weights = None if weights is None else _checked_weights(weights)
        require_solver(solver, "WeightedLaw")
        self.solver = solver
        if solver in (None, "own"):
            import qpsafe.hqp.own.solver  # noqa: F401  compile it now if need be, not within the first tick

    def __repr__(self) -> str:
        given = {"ratio": self.ratio} if self.weights is None else {"weights": self.weights}
        return call(self, **given, solver=self.solver)

    def importance(self, count: int) -> tuple[float, ...]:
        """w_1, ..., w_N, w_E for so many tasks.

        Raises:
            ConfigurationError: The law was given weights for another number of tasks, or a ratio too large for so many.
        """
        if self.weights is None:
            if self.ratio > HEAVIEST ** (1.0 / max(count, 1)):
                expected = f"one whose power of {count}, for {counted(count, 'task')}, is at most {HEAVIEST:g}"
                raise ConfigurationError("WeightedLaw", "ratio", self.ratio, expected)
            return tuple(self.ratio ** (count - k) for k in range(count + 1))
        if len(self.weights) != count + 1:
            expected = f"{count + 1} of them for {counted(count, 'task')}"
            raise ConfigurationError("WeightedLaw", "weights", self.weights, expected)
        return self.weights

    def solve(self, problem: LawProblem) -> LawResult:
        """Solve one tick; see `LawProblem` for shapes."""
        n, ends = len(problem.qd0), list(accumulate(len(xd) for _, xd in problem.tasks))
        rows = n + (ends[-1] if ends else 0)
        A, b = np.zeros((rows - n, n)), np.zeros(rows - n)
        for (J, xd), last in zip(problem.tasks, ends, strict=True):
            A[last - len(xd) : last], b[last - len(xd) : last] = J, xd
        matrix, target = np.empty((rows, n)), np.empty(rows)
        into_one(A, b, ends, problem.qd0, problem.activations, self.importance(len(ends)), matrix, target)
        level = Level(matrix, target, target)
        solution = solve_hierarchy([*problem.soft, level], problem.lower, problem.upper, solver=self.solver)
        return LawResult(solution.qd, solution.status, ((1.0, solution),))


def _checked_weights(weights: Any) -> tuple[float, ...]:
    expected = f"numbers from {1.0 / HEAVIEST:g} to {HEAVIEST:g}: w_1, ..., w_N, w_E"
    given = numbers("WeightedLaw", "weights", weights, expected, ndim=1)
    if not (len(given) > 0 and ((given >= 1.0 / HEAVIEST) & (given <= HEAVIEST)).all()):
        raise ConfigurationError("WeightedLaw", "weights", weights, expected)
    return tuple(given.tolist())


def into_one(
    A: Array, b: Array, ends: Any, qd0: Array, activations: Any, importance: Any, matrix: Array, target: Array
) -> None:
    """Write the weighted sum as one level: √w_E (q̇ = q̇0), then √(a_k w_k) (J_k q̇ = ẋ_k).

    Args:
        A: (rows, n) Jacobians of all tasks, one below the other.
        b: (rows,) their velocities.
        ends: (tasks,) one past the last row of each.
        qd0: (n,) evasive velocity.
        activations: (tasks,).
        importance: (tasks + 1,) w_1, ..., w_N, w_E.
        matrix: (n + rows, n) result.
        target: (n + rows,) result.
    """
    n, tasks, first = len(qd0), len(ends), 0
    scale = math.sqrt(importance[tasks])
    for i in range(n):
        target[i] = scale * qd0[i]
        for j in range(n):
            matrix[i, j] = scale if i == j else 0.0
    for k in range(tasks):
        scale = math.sqrt(activations[k] * importance[k])  # ||s (J q̇ - ẋ)||² = s² ||J q̇ - ẋ||²
        for i in range(first, ends[k]):
            target[n + i] = scale * b[i]
            for j in range(n):
                matrix[n + i, j] = scale * A[i, j]
        first = ends[k]


into_one_compiled = inline(into_one)
