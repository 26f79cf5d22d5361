"""The back ends: agreement with the own solver where they answer, and the fallback where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from qpsafe.hqp import cascade
from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import solve_hierarchy


def problems(count):
    rng = np.random.default_rng(11)
    for i in range(count):
        n = int(rng.integers(1, 10))
        J, L = rng.standard_normal((2, 3, n))
        if i % 4 == 1:
            J[2] = J[0] - 2.0 * J[1]
        if i % 4 == 2:
            L[0] = J[0]
        scale = 5.0 if i % 4 == 3 else 1.0  # the first level infeasible
        levels = [(J, scale * rng.standard_normal(3)), (L, rng.standard_normal(3)), (np.eye(n), rng.standard_normal(n))]
        if i % 5 == 0:
            low = rng.standard_normal(2)
            levels.insert(0, Level(rng.standard_normal((2, n)), low, low + rng.uniform(0.0, 1.0, 2)))
        yield levels, -rng.uniform(0.1, 1.0, n), rng.uniform(0.1, 1.0, n)


@pytest.mark.parametrize(
    ("solver", "tolerance"), [("daqp", 1e-6), ("qpsolvers:daqp", 1e-5), ("qpsolvers:proxqp", 1e-3)]
)
def test_agrees_with_the_own_solver(solver, tolerance):
    for levels, lower, upper in problems(80):
        own, other = (
            solve_hierarchy(levels, lower, upper),
            solve_hierarchy(levels, lower, upper, solver),
        )
        assert other.status == "solved"
        assert np.all(other.qd >= lower)
        assert np.all(other.qd <= upper)
        # compared by what they achieve: a nearly dependent active set leaves q̇ itself ill-defined
        for ours, theirs in zip(own.residuals, other.residuals, strict=True):
            if abs(theirs - ours) > tolerance:
                assert theirs > ours  # the first difference is in our favour
                break


@pytest.mark.parametrize("answer", [None, "nan", "outside", "raise"])
def test_a_back_end_that_fails_hands_over_to_the_own_solver(monkeypatch, answer):
    def broken(problem, **_):
        if answer == "raise":
            raise RuntimeError("no")
        solution = cascade.qpsolvers.Solution(problem)
        solution.found = answer is not None
        solution.x = {None: None, "nan": np.full(problem.q.size, np.nan), "outside": np.full(problem.q.size, 1e3)}[
            answer
        ]
        return solution

    monkeypatch.setattr(cascade.qpsolvers, "solve_problem", broken)
    levels, lower, upper = next(iter(problems(1)))
    solution = solve_hierarchy(levels, lower, upper, "qpsolvers:daqp")
    assert solution.solver == "own"
    assert solution.status == "solved"
    assert "qpsolvers:daqp failed at level 0" in solution.note
    assert "qpsolvers:daqp failed" in str(solution)
    np.testing.assert_array_equal(solution.qd, solve_hierarchy(levels, lower, upper).qd)
