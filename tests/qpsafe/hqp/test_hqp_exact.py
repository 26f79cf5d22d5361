"""The own solver against exact integer arithmetic, which shares no code and no rounding with it."""

from __future__ import annotations

import hqp_exact as exact
import hqp_family as family
import numpy as np
import pytest
from amounts import some

from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import solve_hierarchy


def triples(hierarchy):
    return ([hierarchy.rows] if hierarchy.rows else []) + hierarchy.levels


def solve(hierarchy, **options):
    levels = [Level(*level) for level in hierarchy.levels]
    return solve_hierarchy(levels, hierarchy.lower, hierarchy.upper, rows=hierarchy.rows, **options)


@pytest.mark.parametrize("kind", family.KINDS)
def test_equals_the_exact_solution(kind):
    rng = np.random.default_rng(family.KINDS.index(kind))
    for _ in range(some(5, of=30)):
        hierarchy = family.one(rng, kind, int(rng.integers(1, 10)))
        solution = solve(hierarchy)
        expected = exact.solve_exactly(triples(hierarchy), hierarchy.lower, hierarchy.upper, solution.qd)
        assert solution.status == "solved"
        np.testing.assert_allclose(solution.qd, expected, rtol=0, atol=1e-9)


def test_drifting_sequences_stay_exact():
    for k, hierarchy in enumerate(family.drift(some(800, of=2000), seed=5)):
        solution = solve(hierarchy)
        assert solution.status == "solved"
        if k % 100 == 0:
            expected = exact.solve_exactly(triples(hierarchy), hierarchy.lower, hierarchy.upper, solution.qd)
            np.testing.assert_allclose(solution.qd, expected, rtol=0, atol=1e-9)


def test_the_exact_solution_does_not_depend_on_the_guess():
    rng = np.random.default_rng(0)
    for kind in family.KINDS:
        hierarchy = family.one(rng, kind, 4)
        for guess in (np.zeros(4), hierarchy.lower, solve(hierarchy).qd):
            answer = exact.solve_exactly(triples(hierarchy), hierarchy.lower, hierarchy.upper, guess)
            np.testing.assert_allclose(answer, solve(hierarchy).qd, rtol=0, atol=1e-9)


def test_infeasible_hard_rows_get_the_exact_least_violation():
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(40):
        n = int(rng.integers(2, 7))
        G, low = family.grid(rng.standard_normal((3, n))), family.grid(2.0 * rng.standard_normal(3))
        lower, upper = np.full(n, -0.5), np.full(n, 0.5)
        wish = family.grid(rng.standard_normal(n))
        hierarchy = family.Hierarchy("", lower, upper, (G, low, low + 0.25), [(np.eye(n), wish, wish)])
        solution = solve(hierarchy)
        expected = exact.solve_exactly(triples(hierarchy), lower, upper, solution.qd)
        np.testing.assert_allclose(solution.qd, expected, rtol=0, atol=1e-9)
        violation = max(np.max(low - G @ expected), np.max(G @ expected - low - 0.25))
        assert solution.status == ("rows infeasible" if violation > 1e-6 else "solved")
        seen.add(solution.status)
    assert seen == {"rows infeasible", "solved"}


def test_inequalities_above_inequalities():
    rng = np.random.default_rng(4)
    for _ in range(40):
        n = int(rng.integers(2, 8))
        levels = []
        for _ in range(3):
            low = family.grid(rng.standard_normal(3))
            width = np.where(rng.random(3) < 0.3, np.inf, family.grid(rng.uniform(0.0, 0.5, 3)))
            levels.append((family.grid(rng.standard_normal((3, n))), low, low + width))
        hierarchy = family.Hierarchy("", np.full(n, -1.0), np.full(n, 1.0), None, levels)
        solution = solve(hierarchy)
        expected = exact.solve_exactly(levels, hierarchy.lower, hierarchy.upper, solution.qd)
        assert solution.status == "solved"
        np.testing.assert_allclose(solution.qd, expected, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_many_joints_and_rows():
    rng = np.random.default_rng(6)
    for n, rows in ((12, 20), (20, 8), (30, 40)):
        A, b = family.grid(rng.standard_normal((rows, n)), 6), family.grid(2.0 * rng.standard_normal(rows), 6)
        B, c = family.grid(rng.standard_normal((4, n)), 6), family.grid(rng.standard_normal(4), 6)
        hierarchy = family.Hierarchy("", np.full(n, -0.25), np.full(n, 0.25), None, [(B, c, c), (A, b, b)])
        solution = solve(hierarchy)
        expected = exact.solve_exactly(hierarchy.levels, hierarchy.lower, hierarchy.upper, solution.qd)
        assert solution.status == "solved"
        np.testing.assert_allclose(solution.qd, expected, rtol=0, atol=1e-9)


def test_the_level_that_presses_against_a_limit_is_named():
    A, b = np.array([[1.0, 1.0, 0.0]]), np.array([5.0])
    solution = solve_hierarchy([(A, b), (np.eye(3), np.array([0.0, 0.0, 9.0]))], -np.ones(3), np.ones(3))
    assert solution.binding == ("joint 0 upper", "joint 1 upper", "joint 2 upper")
    assert solution.pressed_by == (0, 0, 1)
    assert "joint 0 upper (holds back level 0)" in str(solution)
    assert "level 0  1 rows, off by 3" in str(solution)
