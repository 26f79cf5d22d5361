"""All regimes in one compiled call have the bits of one `solve_hierarchy` each, and tell the same story."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.hqp.level import Level
from qpsafe.laws.problem import LawProblem, TaskVelocity


def same(law: qpsafe.HierarchicalLaw, problem: LawProblem) -> None:
    together, one_by_one = law._solve_together(problem), law._solve_one_by_one(problem)
    assert together is not None
    assert np.array_equal(together.qd, one_by_one.qd)
    assert together.status == one_by_one.status
    assert len(together.regimes) == len(one_by_one.regimes)
    for (weight, a), (other, b) in zip(together.regimes, one_by_one.regimes, strict=True):
        assert weight == other
        assert np.array_equal(a.qd, b.qd)
        assert (a.status, a.iterations, a.note, a.solver) == (b.status, b.iterations, b.note, b.solver)
        assert (a.binding, a.pressed_by) == (b.binding, b.pressed_by)
        np.testing.assert_array_equal(a.residuals, b.residuals)
        assert str(a).splitlines()[:-1] == str(b).splitlines()[:-1]


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.02]), st.sampled_from([None, np.nan, np.inf]))
def test_bits_and_story_are_the_same(seed: int, damping: float, bad: float | None) -> None:
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(1, 9)), int(rng.integers(1, 4))
    tasks = []
    for _ in range(count):
        rows = int(rng.integers(1, 5))
        J = rng.normal(size=(rows, n))
        if rng.random() < 0.3:
            J[-1] = J[0]
        tasks.append(TaskVelocity(J, rng.normal(size=rows)))
    activations = np.sort(rng.choice([0.0, 0.4, 1.0, rng.random()], count))[::-1]
    limit = rng.uniform(0.0, 1.0, n) * rng.choice([0.3, 10.0])
    lower, upper = -limit, limit
    qd0 = rng.normal(size=n)
    if bad is not None:
        (tasks[0].velocity, tasks[-1].jacobian[0], qd0, lower)[rng.integers(4)][0] = bad
    law = qpsafe.HierarchicalLaw(damping=damping)
    same(law, LawProblem(tuple(tasks), qd0, tuple(activations.tolist()), lower, upper))


def test_what_is_not_plain_is_left_to_the_general_way() -> None:
    law, J = qpsafe.HierarchicalLaw(), np.eye(3)[:2]
    plain = LawProblem((TaskVelocity(J, np.ones(2)),), np.zeros(3), (1.0,), -np.ones(3), np.ones(3))
    same(law, plain)
    row = Level(np.ones((1, 3)), -np.inf, 0.5)
    others = [
        plain._replace(lower=None, upper=None),
        plain._replace(soft=(row,)),
        plain._replace(tasks=(TaskVelocity(J.astype(np.float32), np.ones(2)),)),
        plain._replace(tasks=(TaskVelocity(J.tolist(), [1.0, 1.0]),)),  # type: ignore[arg-type]
    ]
    for problem in others:
        assert np.isfinite(law.solve(problem).qd).all()
    wrong = plain._replace(tasks=(TaskVelocity(J, np.ones(3)), TaskVelocity(J, np.ones(1))), activations=(1.0, 1.0))
    with pytest.raises(qpsafe.ConfigurationError):
        law.solve(wrong)
