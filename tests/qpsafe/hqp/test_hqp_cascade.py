"""The back ends: agreement with the own solver where they answer, and the fallback where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.hqp.backends import cascade, native_proxqp
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
    ("solver", "least"), [("daqp", 70), ("proxqp", 70), ("qpsolvers:daqp", 75), ("qpsolvers:proxqp", 60)]
)
def test_agrees_with_the_own_solver(solver, least):
    answered = 0
    for levels, lower, upper in problems(80):
        own, other = (
            solve_hierarchy(levels, lower, upper),
            solve_hierarchy(levels, lower, upper, solver),
        )
        answered += other.solver == solver  # and not the own solver in its place
        assert other.status == "solved"
        assert np.all(other.qd >= lower)
        assert np.all(other.qd <= upper)
        # compared by what they achieve: a nearly dependent active set leaves q̇ itself ill-defined
        for ours, theirs in zip(own.residuals, other.residuals, strict=True):
            assert abs(theirs - ours) <= 1e-7
    assert answered >= least


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


def drifting(ticks):
    rng = np.random.default_rng(5)
    J, dJ = rng.standard_normal((2, 3, 7))
    b, L, q0 = 2.0 * rng.standard_normal(3), rng.standard_normal((2, 7)), rng.standard_normal(7)
    low = Level(rng.standard_normal((2, 7)), -0.1, 0.1)
    for k in range(ticks):
        yield [low, (J + 0.01 * k * dJ, b), (L, np.ones(2)), (np.eye(7), q0)], np.full(7, -0.5), np.full(7, 0.5)


def test_proxqp_keeps_its_workspaces_and_warm_answers_equal_cold_ones(monkeypatch):
    native_proxqp.forget()
    made = []
    make = native_proxqp.proxqp.dense.QP
    monkeypatch.setattr(native_proxqp.proxqp.dense, "QP", lambda *shape: made.append(shape) or make(*shape))
    warm, turns, after_first = [], [], 0
    for k, (levels, lower, upper) in enumerate(drifting(30)):
        solution = solve_hierarchy(levels, lower, upper, "proxqp")
        assert (solution.solver, solution.status) == ("proxqp", "solved")
        warm.append(solution.qd)
        turns.append(solution.iterations)
        after_first = len(made) if k == 0 else after_first
    assert after_first >= 3  # a workspace a level
    assert len(made) == after_first  # and none after the first tick
    cold_turns = []
    for (levels, lower, upper), qd in zip(drifting(30), warm, strict=True):
        native_proxqp.forget()
        cold = solve_hierarchy(levels, lower, upper, "proxqp")
        cold_turns.append(cold.iterations)
        # equal to 1e-9, not bitwise: warm started, the last bits depend on what was solved before
        np.testing.assert_allclose(cold.qd, qd, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(solve_hierarchy(levels, lower, upper).qd, qd, rtol=0.0, atol=1e-9)
        native_proxqp.forget()
        # cold repeats to rounding; not to the bit, since vectorised sums depend on where the arrays lie in memory
        np.testing.assert_allclose(solve_hierarchy(levels, lower, upper, "proxqp").qd, cold.qd, rtol=0.0, atol=1e-13)
    assert np.sum(turns) < np.sum(cold_turns)  # starting from the last answer is worth it


@pytest.mark.parametrize("answer", ["unsolved", "nan", "raise"])
def test_proxqp_that_fails_hands_over_to_the_own_solver(monkeypatch, answer):
    class Broken:
        """A workspace that never finds anything."""

        def __init__(self, *shape):
            self.qp = make(*shape)
            self.settings, self.init = self.qp.settings, self.qp.init

        def solve(self):
            if answer == "raise":
                raise RuntimeError("no")

        @property
        def results(self):
            if answer == "nan":
                self.qp.results.x = np.full(self.qp.model.dim, np.nan)
            return self.qp.results  # never run: its status says so

    native_proxqp.forget()
    make = native_proxqp.proxqp.dense.QP
    monkeypatch.setattr(native_proxqp.proxqp.dense, "QP", Broken)
    levels, lower, upper = list(problems(2))[1]
    solution = solve_hierarchy(levels, lower, upper, "proxqp")
    assert solution.solver == "own"
    assert "proxqp failed at level 0" in solution.note
    np.testing.assert_array_equal(solution.qd, solve_hierarchy(levels, lower, upper).qd)


def test_threads_have_workspaces_of_their_own():
    from concurrent.futures import ThreadPoolExecutor

    def run(_):
        return [solve_hierarchy(*problem, "proxqp").qd for problem in drifting(20)]

    with ThreadPoolExecutor(2) as pool:
        for answers in pool.map(run, range(2)):
            for (levels, lower, upper), qd in zip(drifting(20), answers, strict=True):
                np.testing.assert_allclose(qd, solve_hierarchy(levels, lower, upper).qd, rtol=0.0, atol=1e-9)


def test_an_unknown_solver_is_named_with_those_that_exist():
    with pytest.raises(ConfigurationError, match='"proxqp"'):
        solve_hierarchy([(np.eye(2), np.ones(2))], solver="prox")
