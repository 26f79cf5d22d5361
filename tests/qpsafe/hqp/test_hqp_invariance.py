"""What must not change the answer of the own solver, and what no data may do to it."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.hqp.level import Level
from qpsafe.hqp.solution import MEANING
from qpsafe.hqp.solve import solve_hierarchy

seeds = st.integers(0, 2**32 - 1)
examples = settings(max_examples=some(10, of=60), deadline=None)


def problem(seed):
    """Two task levels that can share directions, a closing level, and a box that usually binds."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    J, L = rng.standard_normal((3, n)), rng.standard_normal((3, n))
    if rng.random() < 0.3:
        L[0] = J[0] + J[1]
    levels = [(J, rng.standard_normal(3)), (L, rng.standard_normal(3)), (np.eye(n), rng.standard_normal(n))]
    return rng, levels, -rng.uniform(0.1, 1.0, n), rng.uniform(0.1, 1.0, n)


def close(a, b):
    np.testing.assert_allclose(a.qd, b.qd, rtol=0, atol=1e-8)


@examples
@given(seeds)
def test_orthogonal_mixing_of_the_rows_of_a_level(seed):
    rng, levels, lower, upper = problem(seed)
    expected = solve_hierarchy(levels, lower, upper)
    Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    J, b = levels[0]
    close(solve_hierarchy([(Q @ J, Q @ b), *levels[1:]], lower, upper), expected)


@examples
@given(seeds, st.floats(1e-4, 1e4), st.floats(1e-4, 1e4))
def test_units_of_a_level(seed, first, second):
    _, levels, lower, upper = problem(seed)
    (J, b), (L, c), last = levels
    scaled = [(first * J, first * b), (second * L, second * c), last]
    close(solve_hierarchy(scaled, lower, upper), solve_hierarchy(levels, lower, upper))


@examples
@given(seeds)
def test_names_of_the_joints(seed):
    rng, levels, lower, upper = problem(seed)
    p = rng.permutation(lower.size)
    permuted = solve_hierarchy(
        [(A[:, p], b) for A, b in levels[:2]] + [(np.eye(p.size), levels[2][1][p])], lower[p], upper[p]
    )
    np.testing.assert_allclose(permuted.qd, solve_hierarchy(levels, lower, upper).qd[p], rtol=0, atol=1e-8)


@examples
@given(seeds)
def test_units_of_the_speed(seed):
    _, levels, lower, upper = problem(seed)
    halved = solve_hierarchy([(A, 0.5 * b) for A, b in levels], 0.5 * lower, 0.5 * upper)
    np.testing.assert_allclose(2.0 * halved.qd, solve_hierarchy(levels, lower, upper).qd, rtol=0, atol=1e-8)


@examples
@given(seeds)
def test_a_weight_is_a_factor_of_the_squared_violation(seed):
    rng, levels, lower, upper = problem(seed)
    weight = 4.0 ** rng.integers(-3, 4, 3)
    (J, b), *rest = levels
    root = np.sqrt(weight)
    weighted = solve_hierarchy([Level(J, b, b, weight), *rest], lower, upper)
    np.testing.assert_array_equal(weighted.qd, solve_hierarchy([(root[:, None] * J, root * b), *rest], lower, upper).qd)
    np.testing.assert_allclose(weighted.violations[0], J @ weighted.qd - b, rtol=0, atol=1e-12)


@examples
@given(seeds)
def test_levels_below_never_cost_a_level_above(seed):
    _, levels, lower, upper = problem(seed)
    for k in range(1, 3):
        above = solve_hierarchy(levels[:k], lower, upper).residuals
        for residual, alone in zip(solve_hierarchy(levels, lower, upper).residuals, above, strict=False):
            assert residual <= alone + 1e-9


@examples
@given(seeds)
def test_a_wider_box_never_costs_the_first_level(seed):
    _, levels, lower, upper = problem(seed)
    narrow = solve_hierarchy(levels, lower, upper).residuals[0]
    assert solve_hierarchy(levels, lower - 0.1, 2.0 * upper).residuals[0] <= narrow + 1e-9


@examples
@given(seeds)
def test_asking_again_for_what_came_out_changes_nothing(seed):
    _, levels, lower, upper = problem(seed)
    first = solve_hierarchy(levels, lower, upper)
    again = solve_hierarchy([(A, A @ first.qd) for A, _ in levels], lower, upper)
    close(again, first)
    assert max(again.residuals) <= 1e-9


@examples
@given(seeds)
def test_a_level_said_twice_is_said_once(seed):
    _, levels, lower, upper = problem(seed)
    (J, b), *rest = levels
    expected = solve_hierarchy(levels, lower, upper)
    close(solve_hierarchy([(J, b), (J, b), *rest], lower, upper), expected)
    close(solve_hierarchy([(np.vstack((J, J)), np.append(b, b)), *rest], lower, upper), expected)


@examples
@given(seeds)
def test_an_equality_is_two_inequalities(seed):
    _, levels, lower, upper = problem(seed)
    (J, b), *rest = levels
    pair = Level(np.vstack((J, J)), np.append(b, np.full(3, -np.inf)), np.append(np.full(3, np.inf), b))
    close(solve_hierarchy([pair, *rest], lower, upper), solve_hierarchy(levels, lower, upper))


@examples
@given(seeds)
def test_hard_rows_are_a_level_on_top(seed):
    rng, levels, lower, upper = problem(seed)
    G = rng.standard_normal((2, lower.size))
    low = G @ rng.uniform(lower, upper)
    hard = solve_hierarchy(levels, lower, upper, rows=(G, low, np.inf))
    assert hard.status == "solved"
    assert np.all(G @ hard.qd >= low - 1e-9)
    np.testing.assert_array_equal(hard.qd, solve_hierarchy([Level(G, low, np.inf), *levels], lower, upper).qd)


def test_equal_data_give_equal_bits_whatever_was_solved_between():
    first = [problem(seed)[1:] for seed in range(40)]
    answers = [solve_hierarchy(*p).qd.tobytes() for p in first]
    assert answers == [solve_hierarchy(*p).qd.tobytes() for p in first]
    assert answers[::-1] == [solve_hierarchy(*p).qd.tobytes() for p in first[::-1]]


def test_layout_and_ownership_of_arrays_do_not_matter():
    _, levels, lower, upper = problem(7)
    expected = solve_hierarchy(levels, lower, upper).qd
    for array in (lower, upper):
        array.flags.writeable = False
    fortran = [(np.asfortranarray(A), np.repeat(b, 2)[::2]) for A, b in levels]
    np.testing.assert_array_equal(solve_hierarchy(fortran, lower, upper).qd, expected)
    lists = [(A.tolist(), b.tolist()) for A, b in levels]
    np.testing.assert_array_equal(solve_hierarchy(iter(lists), lower.tolist(), upper.tolist()).qd, expected)


def test_a_solution_does_not_change_with_its_inputs():
    _, levels, lower, upper = problem(8)
    solution, twin = solve_hierarchy(levels, lower, upper), solve_hierarchy(levels, lower, upper)
    text = str(twin).rsplit(",", 1)[0]
    for A, b in levels:
        A[:], b[:] = np.nan, np.nan
    lower[:], upper[:] = 0.0, 0.0
    assert str(solution).rsplit(",", 1)[0] == text


def anything(rng, shape):
    """Numbers of all sizes, and what is not a number."""
    a = rng.standard_normal(shape)
    if rng.random() < 0.4:
        a = a * 10.0 ** rng.uniform(-12, 12, shape)
    if rng.random() < 0.2:
        a = a * 10.0 ** rng.integers(-200, 200)
    if rng.random() < 0.3:
        a = np.round(a)
    if rng.random() < 0.1 and a.size:
        a.flat[rng.integers(a.size)] = rng.choice([np.nan, np.inf, -np.inf, 1e300, 5e-324, -0.0])
    return a


@settings(max_examples=some(66, of=400), deadline=None)
@given(seeds)
def test_no_data_raise_leave_the_box_or_repeat_differently(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 31 if rng.random() < 0.1 else 9))
    levels = []
    for _ in range(rng.integers(0, 5)):
        rows = int(rng.integers(0, 41 if rng.random() < 0.1 else 8))
        A, b = anything(rng, (rows, n)), anything(rng, rows)
        if rng.random() < 0.4:
            with np.errstate(over="ignore", invalid="ignore"):
                high = b + np.abs(anything(rng, rows))
            weight = np.abs(anything(rng, rows)) if rng.random() < 0.3 else None
            levels.append(Level(A, b, high, weight))
        else:
            levels.append((A, b))
    lower, upper = anything(rng, n), anything(rng, n)
    if rng.random() < 0.8:
        lower, upper = np.minimum(lower, upper), np.maximum(lower, upper)
    damping = float(rng.choice([0.0, 0.0, 0.1]))
    solution = solve_hierarchy(levels, lower, upper, damping=damping)
    assert solution.status in MEANING
    assert str(solution)
    assert np.all(np.isfinite(solution.qd))
    valid = (lower <= upper) & (lower < 1e60) & (upper > -1e60)
    lowest, highest = np.where(lower < -1e60, -np.inf, lower), np.where(upper > 1e60, np.inf, upper)  # as documented
    assert np.all(solution.qd[valid] >= lowest[valid])
    assert np.all(solution.qd[valid] <= highest[valid])
    assert solution.qd.tobytes() == solve_hierarchy(levels, lower, upper, damping=damping).qd.tobytes()


@pytest.mark.parametrize("n", [1, 2, 30])
def test_fixed_joints_stay_fixed(n):
    rng = np.random.default_rng(n)
    point = rng.standard_normal(n)
    solution = solve_hierarchy([(rng.standard_normal((2, n)), np.ones(2))], point, point)
    np.testing.assert_array_equal(solution.qd, point)
    assert solution.status == "solved"
    assert solution.binding == tuple(f"joint {i} fixed" for i in range(n))
