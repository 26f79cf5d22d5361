"""What `solve_hierarchy` promises for every solver: the right answer, inside the limits, whatever the data."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import some
from scipy.optimize import lsq_linear

from qpsafe.errors import ConfigurationError
from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import solve_hierarchy

SOLVERS = ["own", "daqp", "qpsolvers:daqp", "qpsolvers:proxqp"]


def by_pseudoinverses(levels, n):
    """Lexicographic least squares without limits, by pseudoinverses of the projected matrices."""
    x, N = np.zeros(n), np.eye(n)
    for A, b in levels:
        U, S, Vt = np.linalg.svd(A @ N, full_matrices=False)
        keep = 1e-10 * np.linalg.norm(A) < S
        P = (Vt[keep].T / S[keep]) @ U[:, keep].T
        x, N = x + P @ (b - A @ x), N - P @ (A @ N)
    return x


def random_levels(rng, n):
    """Two task levels and a closing one, with dependent, shared and zero rows among them."""
    J, L = rng.standard_normal((3, n)), rng.standard_normal((3, n))
    if rng.random() < 0.4:
        J[2] = J[0] - 2.0 * J[1]
    if rng.random() < 0.4:
        L[0] = J[0]
    if rng.random() < 0.2:
        L[1] = 0.0
    return [(J, rng.standard_normal(3)), (L, rng.standard_normal(3)), (np.eye(n), rng.standard_normal(n))]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("limit", [np.inf, 1e5])
def test_equals_pseudoinverses_while_limits_are_inactive(solver, limit):
    rng = np.random.default_rng(1)
    for _ in range(some(25, of=60)):
        n = int(rng.integers(1, 10))
        levels = random_levels(rng, n)
        solution = solve_hierarchy(levels, np.full(n, -limit), np.full(n, limit), solver=solver)
        assert solution.status == "solved"
        assert solution.binding == ()
        expected = by_pseudoinverses(levels, n)
        tolerance = 1e-6 if solver == "daqp" else 1e-9  # its soft constraints are regularised
        np.testing.assert_allclose(solution.qd, expected, rtol=0, atol=tolerance * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("solver", ["own", "daqp", "qpsolvers:daqp"])
def test_first_level_is_as_good_as_bounded_least_squares(solver):
    rng = np.random.default_rng(2)
    for _ in range(60):
        n = int(rng.integers(1, 10))
        levels = random_levels(rng, n)
        lower, upper = -rng.random(n), rng.random(n)
        solution = solve_hierarchy(levels, lower, upper, solver=solver)
        assert solution.status == "solved"
        assert np.all(solution.qd >= lower)
        assert np.all(solution.qd <= upper)
        best = lsq_linear(*levels[0], (lower, upper), method="bvls", tol=1e-14)
        assert solution.residuals[0] <= np.linalg.norm(best.fun) + 1e-8


@pytest.mark.parametrize("solver", SOLVERS)
def test_smallest_norm_where_levels_leave_freedom(solver):
    rng = np.random.default_rng(3)
    A, b = rng.standard_normal((2, 6)), rng.standard_normal(2)
    np.testing.assert_allclose(solve_hierarchy([(A, b)], solver=solver).qd, np.linalg.pinv(A) @ b, atol=1e-9)
    np.testing.assert_array_equal(solve_hierarchy([], -np.ones(3), np.ones(3), solver=solver).qd, np.zeros(3))


@pytest.mark.parametrize("solver", SOLVERS)
def test_inequality_level_costs_nothing_while_it_can_be_met(solver):
    A = np.array([[1.0, 1.0, 0.0]])
    wish = (np.eye(3), np.array([1.0, 2.0, 3.0]))
    solution = solve_hierarchy([Level(A, -np.inf, 1.0), wish], solver=solver)
    np.testing.assert_allclose(solution.qd, [0.0, 1.0, 3.0], atol=1e-9)  # projection of the wish on the half space
    loose = solve_hierarchy([Level(A, -np.inf, 4.0), wish], solver=solver)
    np.testing.assert_allclose(loose.qd, wish[1], atol=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
def test_hard_rows_that_contradict_the_box_are_reported(solver):
    G = np.array([[1.0, 1.0]])
    solution = solve_hierarchy(
        [(np.eye(2), np.zeros(2))], -np.ones(2), np.ones(2), solver=solver, rows=(G, 3.0, np.inf)
    )
    assert solution.status == "rows infeasible"
    np.testing.assert_allclose(solution.qd, [1.0, 1.0], atol=1e-9)
    met = solve_hierarchy([(np.eye(2), np.zeros(2))], -np.ones(2), np.ones(2), solver=solver, rows=(G, 1.0, np.inf))
    assert met.status == "solved"
    np.testing.assert_allclose(met.qd, [0.5, 0.5], atol=1e-9)
    assert met.binding == ("row 0 lower",)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_bad_data_give_the_nearest_allowed_speed(solver, bad):
    lower, upper = np.array([-1.0, 0.5]), np.array([1.0, 1.0])
    for level in [(np.array([[1.0, bad]]), [1.0]), (np.eye(2), [0.0, bad]), Level(np.eye(2), 0.0, 1.0, bad)]:
        solution = solve_hierarchy([level], lower, upper, solver=solver)
        assert solution.status == "invalid data"
        np.testing.assert_array_equal(solution.qd, [0.0, 0.5])
        assert "invalid data" in str(solution)


@pytest.mark.parametrize("solver", SOLVERS)
def test_impossible_limits_are_reported(solver):
    level = (np.eye(3), np.ones(3))
    for lower, upper in [([1, 0, 0], [-1, 1, 1]), ([np.nan, 0, 0], [1, 1, 1]), ([np.inf, 0, 0], [np.inf, 1, 1])]:
        solution = solve_hierarchy([level], np.array(lower, float), np.array(upper, float), solver=solver)
        assert solution.status == "invalid limits"
        np.testing.assert_array_equal(solution.qd, np.zeros(3))


def test_configuration_errors():
    A, b = np.eye(2), np.zeros(2)
    for arguments in [([(A, np.zeros(3))],), ([(A, b)], np.zeros(3)), ([(A, b), (np.eye(3), np.zeros(3))],), ([],)]:
        with pytest.raises(ConfigurationError):
            solve_hierarchy(*arguments)
    with pytest.raises(ConfigurationError, match="solver"):
        solve_hierarchy([(A, b)], solver="qpsolvers:no such")
    with pytest.raises(ConfigurationError, match="rows"):
        solve_hierarchy([(A, b)], rows=(np.eye(3), 0.0, 1.0))


def test_empty_and_zero_levels_change_nothing():
    level = (np.array([[1.0, 2.0]]), np.array([1.0]))
    expected = solve_hierarchy([level]).qd
    nothing, zero = (np.empty((0, 2)), np.empty(0)), (np.zeros((3, 2)), np.ones(3))
    solution = solve_hierarchy([nothing, zero, level, nothing])
    assert solution.status == "solved"
    np.testing.assert_allclose(solution.qd, expected, atol=1e-12)
    np.testing.assert_allclose(solution.residuals[1], np.sqrt(3.0))
