"""The laws: eqs. (17), (18), (20), (22) against hierarchical and weighted QPs (derivations, section 1)."""

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from qpsafe.errors import ConfigurationError
from qpsafe.laws.equivalence import compare_states, random_states
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw, nullspace_velocity, pseudoinverse
from qpsafe.laws.problem import LawProblem, TaskVelocity
from qpsafe.laws.projections import regimes_of
from qpsafe.laws.weighted import WeightedLaw

STATES = list(random_states(54, seed=11))
state = st.sampled_from(STATES)
unit = st.floats(0.0, 1.0)


def test_null_space_law_is_the_blend_of_three_regimes() -> None:
    """(22) = (1-m) q̇0 + m (1-f) q̇_medium + m f q̇_low, with rank-deficient Jacobians among the states."""
    for s in random_states(300, seed=5):
        regimes = regimes_of(s.problem().tasks, s.qd0)
        blend = (1 - s.m) * regimes[0] + s.m * (1 - s.f) * regimes[1] + s.m * s.f * regimes[2]
        assert s.paper_velocity() == pytest.approx(blend, abs=1e-10)


@given(state, unit)
def test_equation_18_is_22_without_a_low_task(s, m: float) -> None:
    """(18): q̇ = m P(J) ẋ + (I - m P(J) J) q̇0, evaluated here on its own."""
    n = len(s.qd0)
    P = np.linalg.pinv(s.J_H, rcond=1e-10)
    expected = m * P @ s.xd_H + (np.eye(n) - m * P @ s.J_H) @ s.qd0
    law = nullspace_velocity(s.J_H, np.zeros((0, n)), s.xd_H, np.zeros(0), s.qd0, m, 1.0)
    assert law == pytest.approx(expected, abs=1e-10)
    problem = LawProblem((TaskVelocity(s.J_H, s.xd_H),), s.qd0, (m,))
    assert NullspaceLaw().solve(problem).qd == pytest.approx(expected, abs=1e-10)
    assert HierarchicalLaw("paper").solve(problem).qd == pytest.approx(expected, abs=1e-8)


@settings(max_examples=some(12, of=30))
@given(state)
def test_equation_18_is_one_hierarchy_with_a_mixed_target(s) -> None:
    """(18) equals [J q̇ = m ẋ + (1-m) J q̇0 ≻ E], for singular J too."""
    import qpsafe

    m, n = 0.3, len(s.qd0)
    target = m * s.xd_H + (1 - m) * s.J_H @ s.qd0
    hierarchy = qpsafe.solve_hierarchy([(s.J_H, target), (np.eye(n), s.qd0)])
    law = nullspace_velocity(s.J_H, np.zeros((0, n)), s.xd_H, np.zeros(0), s.qd0, m, 1.0)
    assert hierarchy.qd == pytest.approx(law, abs=1e-8)


@pytest.mark.parametrize("with_limits", [False, True])
def test_paper_projection_equals_equation_22(with_limits: bool) -> None:
    for deviation in compare_states(HierarchicalLaw("paper"), some(216, of=540), seed=2, with_limits=with_limits):
        assert deviation.worst <= 1e-8, deviation.kind


def test_random_states_cover_what_they_promise() -> None:
    states = list(random_states(540, seed=0))
    assert {len(s.qd0) for s in states} == {6, 7, 9}
    assert {(s.m, s.f) for s in states} >= {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}
    ranks = [np.linalg.matrix_rank(np.vstack((s.J_H, s.J_L)), tol=1e-9) for s in states if s.kind.startswith("irb140,")]
    assert ranks
    assert max(ranks) == 5  # wrist and elbow singular poses are exactly singular


def test_strict_projection_meets_the_low_task_whenever_the_high_one_leaves_room() -> None:
    """What lexicographic QPs buy: independent tasks are both met exactly, which (22) does not do."""
    worse = 0
    for s in STATES:
        J = np.vstack((s.J_H, s.J_L))
        if np.linalg.matrix_rank(J, tol=1e-6) < len(J) or np.linalg.cond(J) > 1e3:
            continue
        problem = s._replace(m=1.0, f=1.0).problem()
        strict, paper = (HierarchicalLaw(p).solve(problem).qd for p in ("strict", "paper"))
        assert s.J_H @ strict == pytest.approx(s.xd_H, abs=1e-7)
        assert s.J_L @ strict == pytest.approx(s.xd_L, abs=1e-7)
        worse += np.abs(s.J_L @ paper - s.xd_L).max(initial=0.0) > 1e-3
    assert worse > 0


@pytest.mark.parametrize("projection", ["strict", "paper"])
def test_orthogonal_tasks_make_both_projections_equal(projection: str) -> None:
    rng = np.random.default_rng(4)
    Q = np.linalg.qr(rng.normal(size=(7, 7)))[0]
    J_H, J_L = rng.normal(size=(3, 3)) @ Q[:3], rng.normal(size=(3, 3)) @ Q[3:6]
    tasks = (TaskVelocity(J_H, rng.normal(size=3)), TaskVelocity(J_L, rng.normal(size=3)))
    problem = LawProblem(tasks, rng.normal(size=7), (1.0, 0.7))
    assert HierarchicalLaw(projection).solve(problem).qd == pytest.approx(NullspaceLaw().solve(problem).qd, abs=1e-8)


@settings(max_examples=some(8, of=40), deadline=None)
@given(state, unit, unit, st.floats(0.05, 2.0), st.sampled_from(("strict", "paper")))
def test_limits_hold_for_every_blend(s, m: float, f: float, bound: float, projection) -> None:
    result = HierarchicalLaw(projection).solve(s._replace(m=m, f=f).problem(bound))
    assert (np.abs(result.qd) <= bound + 1e-9).all()
    result = WeightedLaw().solve(s._replace(m=m, f=f).problem(bound))
    assert (np.abs(result.qd) <= bound + 1e-9).all()


@settings(max_examples=some(10, of=25), deadline=None)
@given(state, st.floats(0.05, 1.0))
def test_medium_regime_is_optimal_under_limits(s, bound: float) -> None:
    """The residual of the first task equals that of an independent bounded least-squares solver."""
    result = HierarchicalLaw().solve(s._replace(m=1.0, f=0.0).problem(bound))
    best = lsq_linear(s.J_H, s.xd_H, (-bound, bound), tol=1e-14)
    assert np.linalg.norm(s.J_H @ result.qd - s.xd_H) <= np.linalg.norm(s.J_H @ best.x - s.xd_H) + 1e-7


@settings(max_examples=some(10, of=25), deadline=None)
@given(state, unit, st.floats(0.0, 1e-4))
def test_blend_is_continuous_in_the_activations(s, m: float, step: float) -> None:
    law = HierarchicalLaw()
    qd = [law.solve(s._replace(m=value, f=0.5).problem(1.0)).qd for value in (m, min(m + step, 1.0))]
    assert np.abs(qd[1] - qd[0]).max() <= 2.0 * 2.0 * step + 1e-8  # regimes differ by at most 2 bounds, twice


def test_weighted_law_minimises_its_own_sum() -> None:
    rng = np.random.default_rng(8)
    for s in STATES[:20]:
        problem = s.problem(0.5)
        law = WeightedLaw(ratio=50.0)
        qd = law.solve(problem).qd
        w_H, w_L = s.m * 50.0**2, s.m * s.f * 50.0

        def cost(x: np.ndarray, s=s, w_H=w_H, w_L=w_L) -> float:
            high, low = s.J_H @ x - s.xd_H, s.J_L @ x - s.xd_L
            return w_H * high @ high + w_L * low @ low + (x - s.qd0) @ (x - s.qd0)

        for _ in range(50):
            other = np.clip(qd + rng.normal(size=len(qd)) * rng.choice((1e-3, 0.1)), -0.5, 0.5)
            assert cost(qd) <= cost(other) + 1e-8


def test_weighted_law_tends_to_the_strict_hierarchy() -> None:
    s = next(x for x in STATES if x.kind == "independent, n = 7")._replace(m=1.0, f=1.0)
    strict = HierarchicalLaw("strict").solve(s.problem()).qd
    far, near = (np.abs(WeightedLaw(ratio=r).solve(s.problem()).qd - strict).max() for r in (1e2, 1e4))
    assert near < 0.1 * far


def test_more_than_two_tasks_keep_the_order() -> None:
    rng = np.random.default_rng(6)
    tasks = tuple(TaskVelocity(rng.normal(size=(2, 7)), rng.normal(size=2)) for _ in range(3))
    qd0 = rng.normal(size=7)
    for kept in range(4):
        a = tuple(1.0 if k < kept else 0.0 for k in range(3))
        qd = HierarchicalLaw("strict").solve(LawProblem(tasks, qd0, a)).qd
        for J, xd in tasks[:kept]:
            assert J @ qd == pytest.approx(xd, abs=1e-8)
        paper = HierarchicalLaw("paper").solve(LawProblem(tasks, qd0, a)).qd
        assert paper == pytest.approx(NullspaceLaw().solve(LawProblem(tasks, qd0, a)).qd, abs=1e-8)


def test_pseudoinverse_meets_the_four_penrose_conditions() -> None:
    for s in STATES:
        A, P = s.J_L, pseudoinverse(s.J_L)
        for left, right in ((A @ P @ A, A), (P @ A @ P, P), ((A @ P).T, A @ P), ((P @ A).T, P @ A)):
            assert left == pytest.approx(right, abs=1e-8 * max(1.0, np.abs(P).max(initial=0.0)))


def test_wrong_law_settings_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="projection"):
        HierarchicalLaw("loose")  # type: ignore[arg-type]
    for ratio in (1.0, -3.0, np.nan, np.inf):
        with pytest.raises(ConfigurationError, match="ratio"):
            WeightedLaw(ratio)


@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.sampled_from([np.inf, -np.inf, np.nan, 1e61, -1e308]))
def test_a_jacobian_that_is_not_finite_is_refused_at_once(seed: int, rows: int, bad: float) -> None:
    """LAPACK's singular values of a matrix with infinities may never come; seen with two such rows of five."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(rows, 14))
    A[rng.random(A.shape) < rng.choice([0.02, 0.5, 1.0])] = bad
    A[rng.integers(rows), rng.integers(14)] = bad
    with pytest.raises(ValueError, match="not finite"):
        pseudoinverse(A)
