"""Interval rows: the own solver and the back ends against exact arithmetic, and what must not change the answer."""

from __future__ import annotations

import hqp_intervals as family
import numpy as np
import pytest
from amounts import first, some
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import solve_hierarchy

examples = settings(max_examples=some(10, of=60), deadline=None)
seeds = st.integers(0, 2**32 - 1)

#: Seeds of the family whose rows are crossed whole, then left at a vertex: found by search, one in 5,000 is like them.
CROSSED = (9552, 16639, 19007, 20655, 23884, 29904, 31818, 32502, 49049, 54103, 54268, 57332)


def drawn(seed):
    rng = np.random.default_rng(seed)
    return rng, family.one(rng)


def judged(problem):
    solution = family.solve(problem)
    return family.verdict(problem, solution, family.exact(problem, solution.qd))


def test_rounding_where_all_numbers_vanish_holds_nothing():
    """A joint returns to zero but for 7e-18; the multiplier there is rounding, and the level below may move."""
    levels = [
        Level([[0.875, 1.125, -1.5], [-0.875, -1.125, 1.5]], [-0.25, -0.375], [-0.125, np.inf]),
        Level(
            [[1.0, 0.75, 0.625], [1.0, 0.0, 0.0], [0.375, 0.375, 0.625]], [-np.inf, 0.0, -np.inf], [0.25, 0.25, 0.125]
        ),
        Level([[-0.875, -1.125, 1.5]], 0.421875, 0.421875),
    ]
    infinite = np.full(3, np.inf)
    assert judged(family.Intervals(-infinite, infinite, levels, False)) == "right"


@pytest.mark.parametrize("seed", CROSSED)
def test_rows_crossed_whole_count_on_at_their_other_bound(seed):
    assert judged(drawn(seed)[1]) == "right"


def test_equals_the_exact_solution():
    count = some(80, of=600)
    assert family.judge(count, seed=2026)["own"] == {"right": count}


@pytest.mark.slow
def test_equals_the_exact_solution_many_times():
    assert family.judge(20_000, seed=13)["own"] == {"right": 20_000}


@pytest.mark.parametrize(("solver", "least"), first(1, [("daqp", 60), ("proxqp", 140), ("qpsolvers:daqp", 140)]))
def test_back_ends_are_right_or_hand_over_to_the_own_solver(solver, least):
    found = family.judge(150, seed=7, solvers=(solver,))[solver]
    assert found["right"] + found["handed over"] == 150
    assert found["right"] >= least  # answers of the back end's own


def scaled(problem, factors):
    """Rows times factors: another problem within a level, the same one where a level has one factor."""
    levels = [
        Level(f[:, None] * p.A, f * p.lower, f * p.upper, p.weight)
        for f, p in zip(factors, problem.levels, strict=True)
    ]
    return problem._replace(levels=levels)


def test_units_of_levels_far_apart_are_solved_all_the_same():
    rng = np.random.default_rng(1)
    for problem in family.family(some(60, of=150), seed=3):
        factors = [np.full(p.rows, 2.0 ** rng.integers(-40, 41)) for p in problem.levels]
        assert judged(scaled(problem, factors)) == "right"


@pytest.mark.parametrize("bits", [4, 12, 16])
def test_rows_of_a_level_far_apart_are_solved_or_reported(bits):
    rng = np.random.default_rng(2)
    verdicts = []
    for problem in family.family(some(80, of=150), seed=4):
        factors = [2.0 ** rng.integers(-bits, bits + 1, p.rows) for p in problem.levels]
        verdicts.append(judged(scaled(problem, factors)))
    assert set(verdicts) <= {
        "right",
        "ill-conditioned",
        "rows infeasible",
    }  # the last: rows are violated, whoever erred
    assert ("ill-conditioned" in verdicts) == (bits > 4)


def test_limits_nearly_parallel_are_reported():
    A = np.array([[1.0, 0.0], [1.0, 2.0**-24]])
    for gap in (0.0, 2.0**-26):  # both rows hold back what wishes for much more
        rows = (A, np.full(2, -np.inf), np.array([1.0, 1.0 + gap]))
        solution = solve_hierarchy([(np.eye(2), [4.0, 4.0])], -8.0 * np.ones(2), 8.0 * np.ones(2), rows=rows)
        exact = family.exact(
            family.Intervals(-8.0 * np.ones(2), 8.0 * np.ones(2), [Level(*rows), Level(np.eye(2), 4.0, 4.0)], True),
            solution.qd,
        )
        assert solution.status == "ill-conditioned" or np.abs(solution.qd - exact).max() <= 1e-7


def same(problem, other):
    """Equal statuses, and equal points to rounding."""
    one, two = family.solve(problem), family.solve(other)
    assume(one.status != "ill-conditioned" and two.status != "ill-conditioned")
    assert one.status == two.status
    np.testing.assert_allclose(two.qd, one.qd, rtol=1e-7, atol=1e-7)


def with_level(problem, k, level):
    return problem._replace(levels=[*problem.levels[:k], level, *problem.levels[k + 1 :]])


@examples
@given(seeds)
def test_a_row_and_its_weight_in_other_units(seed):
    rng, problem = drawn(seed)
    problem = problem._replace(hard=False)
    k = int(rng.integers(len(problem.levels)))
    p = problem.levels[k]
    f = 2.0 ** rng.integers(-20, 21, p.rows)
    weight = np.ones(p.rows) if p.weight is None else p.weight
    other = with_level(problem, k, Level(f[:, None] * p.A, f * p.lower, f * p.upper, weight / f**2))
    np.testing.assert_array_equal(family.solve(other).qd, family.solve(problem).qd)
    assert family.solve(other).status == family.solve(problem).status


@examples
@given(seeds)
def test_units_of_each_hard_row(seed):
    rng, problem = drawn(seed)
    problem = problem._replace(hard=True, levels=[Level(p.A, p.lower, p.upper) for p in problem.levels])
    assume(family.solve(problem).status == "solved")  # violated rows are weighed against each other in their units
    top = problem.levels[0]
    f = 10.0 ** rng.uniform(-2.0, 2.0, top.rows)
    same(problem, with_level(problem, 0, Level(f[:, None] * top.A, f * top.lower, f * top.upper)))


@examples
@given(seeds)
def test_order_of_the_rows(seed):
    rng, problem = drawn(seed)
    k = int(rng.integers(len(problem.levels)))
    p = problem.levels[k]
    order = rng.permutation(p.rows)
    weight = None if p.weight is None else p.weight[order]
    same(problem, with_level(problem, k, Level(p.A[order], p.lower[order], p.upper[order], weight)))


@examples
@given(seeds)
def test_an_interval_is_two_one_sided_rows(seed):
    rng, problem = drawn(seed)
    k = int(rng.integers(len(problem.levels)))
    p, none = problem.levels[k], np.full(problem.levels[k].rows, np.inf)
    weight = None if p.weight is None else np.append(p.weight, p.weight)
    split = Level(np.vstack((p.A, p.A)), np.append(p.lower, -none), np.append(none, p.upper), weight)
    same(problem, with_level(problem, k, split))


@examples
@given(seeds)
def test_a_row_said_twice_has_twice_the_weight(seed):
    rng, problem = drawn(seed)
    problem = problem._replace(hard=False)
    k = int(rng.integers(len(problem.levels)))
    p = problem.levels[k]
    i = int(rng.integers(p.rows))
    weight = np.ones(p.rows) if p.weight is None else p.weight
    A, lower, upper = (np.concatenate((part, part[i : i + 1])) for part in (p.A, p.lower, p.upper))
    twice = Level(A, lower, upper, np.append(weight, weight[i]))
    double = Level(p.A, p.lower, p.upper, np.where(np.arange(p.rows) == i, 2.0, 1.0) * weight)
    same(with_level(problem, k, twice), with_level(problem, k, double))


@examples
@given(seeds)
def test_rows_that_are_met_anyway_change_nothing(seed):
    rng, problem = drawn(seed)
    k = int(rng.integers(len(problem.levels)))
    p = problem.levels[k]
    a = rng.standard_normal((2, p.A.shape[1]))
    box = np.maximum(np.abs(problem.lower), np.abs(problem.upper))
    reach = np.abs(a) @ np.where(np.isfinite(box), box, 1e3) + 1.0  # beyond any point on the way
    weight = None if p.weight is None else np.append(p.weight, np.ones(2))
    more = Level(np.vstack((p.A, a)), np.append(p.lower, -reach), np.append(p.upper, reach), weight)
    same(problem, with_level(problem, k, more))
