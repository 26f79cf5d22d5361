"""The compiled stage of the paper's, the null-space and the weighted law: against NumPy and against `solve`."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from amounts import first, some

import qpsafe
from qpsafe.danger.activation import regime_weights as weights_of
from qpsafe.hqp.own.regimes import layout_for
from qpsafe.laws.explained import Solved, explain
from qpsafe.laws.kinds import NULLSPACE, OTHER, PAPER, STRICT, WEIGHTED, kind_of, numbers_of
from qpsafe.laws.problem import LawProblem, TaskVelocity
from qpsafe.laws.projections import regimes_of
from qpsafe.pipeline.law_kernel import law_tick
from qpsafe.pipeline.resolve_kernel import Parts, given, parts, sizes_of

Array = np.ndarray
LAWS = {
    PAPER: qpsafe.HierarchicalLaw("paper"),
    NULLSPACE: qpsafe.NullspaceLaw(),
    WEIGHTED: qpsafe.WeightedLaw(50.0),
}


def near_singular(J: Array) -> bool:
    """Neither singular nor far from it: any method loses digits."""
    S = np.linalg.svd(J, compute_uv=False) if J.size else np.zeros(1)
    S /= max(S[0], 1e-300)
    return bool(np.any((S > 1e-10) & (S < 1e-2)))


def jacobians(rng: np.random.Generator, n: int, tasks: int) -> list[Array]:
    """Of one to six rows, some of them rank-deficient, zero, or shared with the task above."""
    while True:
        made: list[Array] = []
        for _ in range(tasks):
            rows, kind = int(rng.integers(1, 7)), rng.integers(4)
            J = rng.normal(size=(rows, n))
            if kind == 1:
                rank = rng.integers(0, min(rows, n) + 1)
                J = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, n))
            if kind == 2 and made:
                J[0] = rng.normal(size=len(made[-1])) @ made[-1]
            made.append(J)
        if not any(near_singular(J) for J in [*made, *(np.vstack(made[: k + 1]) for k in range(tasks))]):
            return made


def problems(count: int, seed: int, bound: float | None = None) -> list[LawProblem]:
    """Random problems; with limits that bind if `bound` is small."""
    rng, found = np.random.default_rng(seed), []
    for k in range(count):
        n, tasks = int(rng.integers(2, 15)), 1 + k % 3
        wishes = tuple(TaskVelocity(J, rng.normal(size=len(J))) for J in jacobians(rng, n, tasks))
        draws = [rng.choice((0.0, 1.0, rng.uniform())) for _ in wishes]
        limits = None if bound is None else bound * rng.uniform(0.1, 1.0, (2, n))
        lower, upper = (None, None) if limits is None else (-limits[0], limits[1])
        found.append(LawProblem(wishes, rng.normal(size=n), tuple(np.cumprod(draws).tolist()), lower, upper))
    return found


def by_numpy(p: LawProblem, kept: int, first: int = 0) -> Array:
    """Σ_i N_(i-1) P(J_i) ẋ_i + N_kept q̇0 by pseudoinverses, the sum from task `first` on."""
    n = len(p.qd0)
    qd, N, above = np.zeros(n), np.eye(n), np.zeros((0, n))
    for i, (J, xd) in enumerate(p.tasks[:kept]):
        qd += N @ np.linalg.pinv(J, rcond=1e-10) @ xd if i >= first else 0.0
        above = np.vstack((above, J))
        N = np.eye(n) - np.linalg.pinv(above, rcond=1e-10) @ above
    return qd + N @ p.qd0


class Answer(NamedTuple):
    """What the compiled stage made of a problem."""

    blend: Array
    command: Array
    excess: float
    result: Any


def stage(kind: int, p: LawProblem, explained: bool = True) -> Answer:
    """Ask the compiled stage, whose memory held something else before."""
    law, n, tasks = LAWS[kind], len(p.qd0), len(p.tasks)
    counts = tuple(len(xd) for _, xd in p.tasks)
    rows = sum(counts)
    layout = layout_for(n, counts, kind == WEIGHTED)
    for memory in (layout.floats, layout.matrix, layout.target):
        memory[:] = np.nan
    block = np.full(26 * tasks + 2 + 2 * n, np.nan)
    gains, _, _, _, weights, _, qd0, _ = given(block, n, tasks)
    gains[:], weights[:], qd0[:] = 1.0, weights_of(p.activations), p.qd0
    floats, integers = map(np.zeros, sizes_of(n, rows, tasks + 1), (float, np.int64))
    cut = Parts(*parts(floats, integers, n, rows, tasks + 1))
    cut.A[:], cut.b[:] = np.vstack([J for J, _ in p.tasks]), np.concatenate([xd for _, xd in p.tasks])
    cut.bounds[:] = [[-np.inf], [np.inf]] if p.lower is None else (p.lower, p.upper)
    command = np.empty(n)
    damping, time, importance = numbers_of(law, tasks)
    active = np.array(p.activations)
    excess, worst = law_tick(
        kind, damping, time, np.array(importance), active, 0.004, block, *layout, floats, integers, command
    )
    solved = Solved(cut.A, cut.b, p.qd0, *cut.bounds, cut.blend, cut.x, cut.info, weights.tolist(), counts, 0.0)
    result = explain(solved, worst == 0.0, kind, np.array(importance), p.activations) if explained else None
    return Answer(cut.blend, command, excess, result)


def test_projections_are_those_of_pseudoinverses() -> None:
    """All regimes, 2 to 14 joints, one to three tasks, more rows than joints among them."""
    for p in problems(300, 1):
        found = regimes_of(p.tasks, p.qd0)
        for kept, qd in enumerate(found):
            assert np.abs(qd - by_numpy(p, kept)).max() <= 1e-10


def test_null_space_law_is_the_blend_by_pseudoinverses_and_is_clipped() -> None:
    clipped = 0
    for p in problems(150, 2, 1.0):
        expected = np.asarray(weights_of(p.activations)) @ [by_numpy(p, k) for k in range(len(p.tasks) + 1)]
        answer = stage(NULLSPACE, p)
        assert np.abs(answer.blend - expected).max() <= 1e-10
        assert answer.blend.tobytes() == LAWS[NULLSPACE].solve(p).qd.tobytes() == answer.result.qd.tobytes()
        assert answer.command.tobytes() == np.clip(answer.blend, p.lower, p.upper).tobytes()
        assert answer.excess == np.abs(answer.command - answer.blend).max()
        clipped += answer.excess > 1e-9
    assert clipped > 50


@pytest.mark.parametrize("bound", [None, 0.5, 100.0])
def test_paper_law_is_the_hierarchy_below_its_first_task(bound: float | None) -> None:
    """[J_1 q̇ = ẋ_1 ≻ q̇ = what the paper adds], its second level by pseudoinverses, in limits; regime by regime."""
    bound_somewhere = 0
    for p in problems(some(60, of=120), 3, bound):
        n, law = len(p.qd0), LAWS[PAPER]
        expected = np.zeros(n)
        for kept, weight in enumerate(weights_of(p.activations)):
            closing = by_numpy(p, kept, 1) if kept > 1 else p.qd0
            levels = [*p.tasks[: min(kept, 1)], (np.eye(n), closing)]
            expected += weight * qpsafe.solve_hierarchy(levels, p.lower, p.upper).qd if weight > 0.0 else 0.0
        answer, asked = stage(PAPER, p), law.solve(p)
        assert np.abs(answer.blend - expected).max() <= 1e-10
        assert answer.blend.tobytes() == asked.qd.tobytes()
        assert same(answer.result, asked)
        bound_somewhere += p.upper is not None and np.isclose(np.abs(expected), p.upper).any()
    assert (bound == 0.5) == (bound_somewhere > some(15, of=30))


@pytest.mark.parametrize("bound", [None, 0.5])
def test_weighted_law_is_one_level(bound: float | None) -> None:
    for p in problems(120, 4, bound):
        n, N = len(p.qd0), len(p.tasks)
        scales = [np.sqrt(a * 50.0 ** (N - k)) for k, a in enumerate(p.activations)]
        A = np.vstack([np.eye(n), *(s * J for s, (J, _) in zip(scales, p.tasks, strict=True))])
        b = np.concatenate([p.qd0, *(s * xd for s, (_, xd) in zip(scales, p.tasks, strict=True))])
        answer, asked = stage(WEIGHTED, p), LAWS[WEIGHTED].solve(p)
        assert np.abs(answer.blend - qpsafe.solve_hierarchy([(A, b)], p.lower, p.upper).qd).max() <= 1e-10
        assert answer.blend.tobytes() == asked.qd.tobytes()
        assert same(answer.result, asked)


def same(one: Any, other: Any) -> bool:
    """Whether two results explain themselves alike."""
    assert one.status == other.status
    for (w, a), (v, b) in zip(one.regimes, other.regimes, strict=True):
        assert (w, a.status, a.iterations, a.note) == (v, b.status, b.iterations, b.note)
        assert a.residuals == pytest.approx(b.residuals, abs=1e-12)
        assert a.binding == b.binding
    return True


@pytest.mark.parametrize("kind", LAWS)
def test_what_is_not_finite_is_never_sent(kind: int) -> None:
    for bad in (np.nan, np.inf):
        for p in problems(6, 5):
            p.tasks[0].jacobian[0, 0] = bad
            p, law = p._replace(activations=(1.0,) * len(p.tasks)), LAWS[kind]
            if kind == NULLSPACE or (kind == PAPER and len(p.tasks) > 1):
                assert stage(kind, p, explained=False).excess == -1.0
                with pytest.raises(ValueError, match="not finite"):
                    law.solve(p)
            else:
                answer = stage(kind, p)
                assert np.isfinite(answer.command).all()
                assert answer.result.status == law.solve(p).status == "invalid data"


def test_laws_are_known_by_their_own_types_only() -> None:
    class Own(qpsafe.NullspaceLaw):
        pass

    known = {
        STRICT: [qpsafe.HierarchicalLaw(), qpsafe.HierarchicalLaw(solver="own")],
        PAPER: [qpsafe.HierarchicalLaw("paper")],
        NULLSPACE: [qpsafe.NullspaceLaw()],
        WEIGHTED: [qpsafe.WeightedLaw(), qpsafe.WeightedLaw(weights=(3.0, 2.0, 1.0))],
        OTHER: [Own(), qpsafe.WeightedLaw(solver="daqp"), None],
    }
    for kind, laws in known.items():
        assert [kind_of(law, 2) for law in laws] == [kind] * len(laws)
    assert kind_of(qpsafe.HierarchicalLaw("paper"), 1) == STRICT


def derived(law: Any) -> Any:
    """The same law as one of another making: the controller asks its `solve`."""
    kind = type("Derived", (type(law),), {})
    made = kind.__new__(kind)
    made.__dict__.update(law.__dict__)
    return made


@pytest.mark.parametrize("kind", first(2, LAWS))
def test_a_controller_does_the_same_as_with_the_law_asked_in_python(kind: int, irb140: Any) -> None:
    """Somebody walks up and off again: all regimes, commands to the bit, and what is told about them."""
    law = LAWS[kind]
    goal = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    tasks = [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
    one, other = (qpsafe.SafetyController(irb140, tasks, made) for made in (law, derived(law)))
    q, qd, regimes = np.array(irb140.home), np.zeros(6), set()
    for k in range(300):
        points = irb140.pose("tcp", irb140.home)[:3, 3] + np.array([[abs(0.8 - 0.006 * k) + 0.2, 0.02, 0.05]])
        here, there = one.step(q, qd, points=points), other.step(q, qd, points=points)
        assert here.reference.qd.tobytes() == there.reference.qd.tobytes()
        assert (here.status, here.messages, here.binding) == (there.status, there.messages, there.binding)
        q, qd = here.reference.q, here.reference.qd
        regimes.add(here.regime)
    assert regimes == {"low", "medium", "high"}
