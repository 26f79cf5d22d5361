"""Tasks, limits and law in one compiled call against the same asked one by one: equal bits, and the same story."""

from typing import Any, NamedTuple

import numpy as np
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.laws.problem import LawProblem, TaskVelocity
from qpsafe.pipeline.checks import checked_velocity
from qpsafe.pipeline.resolve import Resolve
from qpsafe.pipeline.resolved import Resolved, judged
from qpsafe.tasks.task import Task
from qpsafe.tasks.trajectory import Sample

goal = qpsafe.FixedPose(np.eye(4))
TASKS: dict[str, list[Any]] = {
    "position and orientation": [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)],
    "one": [qpsafe.FrameTask("flange", goal, 2.0)],
    "three": [
        qpsafe.PositionTask("tcp", goal),
        qpsafe.FrameTask("dh3", goal, rows=(1, 2)),
        qpsafe.OrientationTask("tcp", goal),
    ],
}


def draw(rng: np.random.Generator, robot: Any, tasks: list[Any], spread: float) -> tuple[Any, ...]:
    """A commanded state, samples near and far from it, q̇0 and activations."""
    q = rng.uniform(robot.lower - 0.05, robot.upper + 0.05)
    if rng.random() < 0.3:
        q[4] = 0.0  # singular
    state = robot.at(q)
    samples = []
    for task in tasks:
        pose = robot.pose(task.frame, q + spread * rng.normal(size=robot.nq))
        samples.append(Sample(pose, spread * rng.normal(size=6)))
    qd = rng.uniform(-1.0, 1.0, robot.nq) * robot.max_velocity * rng.choice([0.1, 1.1])
    activations = np.sort(rng.choice([0.0, 0.4, 1.0, rng.random()], len(tasks)))[::-1]
    return state, qd, tuple(samples), rng.normal(size=robot.nq), tuple(activations.tolist())


class Other(NamedTuple):
    """Answers of the parts, asked one by one by their public methods."""

    command: np.ndarray
    excess: float
    solved: bool
    box: Any
    result: Any
    errors: tuple[np.ndarray, ...]


def one_by_one(
    state: Any, qd: np.ndarray, tasks: Any, samples: Any, qd0: Any, activations: Any, law: Any, limits: Any
) -> Other:
    wanted = [Task.clik(task, state, sample) for task, sample in zip(tasks, samples, strict=True)]
    box = None if limits is None else limits.box(state.q, qd, np.zeros(len(qd)))
    lower, upper = (None, None) if box is None else (box.lower, box.upper)
    wishes = tuple(TaskVelocity(clik.jacobian, clik.velocity) for clik in wanted)
    corrections = tuple(task.gain * clik.error for task, clik in zip(tasks, wanted, strict=True))
    result = law.solve(LawProblem(wishes, qd0, activations, lower, upper, (), corrections))
    answer = checked_velocity(result, state.q, 0.004)
    command, excess = (answer, 0.0) if box is None else box.admit(answer)
    return Other(command, excess, result.status == "solved", box, result, tuple(clik.error for clik in wanted))


class Slow(qpsafe.PositionTask):
    """Redefines a method."""

    def velocity(self, error: np.ndarray, sample: Any) -> np.ndarray:
        return 0.5 * super().velocity(error, sample)


class Narrow(qpsafe.JointLimits):
    """Limits of another making."""

    def box(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray | None = None) -> Any:
        box = super().box(q, qd, qdd)
        return box._replace(upper=np.minimum(box.upper, np.maximum(box.lower, 0.2)))


def kinds(robot: Any) -> dict[str, tuple[Any, Any, Any]]:
    """Tasks, law and limits of which none, one or all are of another making than compiled code knows."""
    bounds = robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration
    law, limits = qpsafe.HierarchicalLaw(), qpsafe.JointLimits(*bounds)
    pose, turn = TASKS["position and orientation"]
    return {
        **{f"built in: {key}": (tasks, law, limits) for key, tasks in TASKS.items()},
        "damped": ([pose, turn], qpsafe.HierarchicalLaw(damping=0.02), limits),
        "own task first": ([Slow("tcp", goal), turn], law, limits),
        "own task last": ([pose, qpsafe.OrientationTask("tcp", goal, form="euler")], law, limits),
        "own law": ([pose, turn], qpsafe.WeightedLaw(), limits),
        "null space": ([pose, turn], qpsafe.NullspaceLaw(), limits),
        "paper": ([pose, turn], qpsafe.HierarchicalLaw("paper"), limits),
        "own limits": ([pose, turn], law, Narrow(*bounds)),
        "jerk": ([pose, turn], law, qpsafe.JointLimits(*bounds, max_jerk=np.full(6, 500.0))),
        "no limits": ([pose, turn], law, None),
        "all": ([Slow("tcp", goal), turn], qpsafe.WeightedLaw(), Narrow(*bounds)),
    }


def compare(robot: Any, one: Resolved, other: Other) -> None:
    assert (one.box is None) == (other.box is None)
    for a, b in zip(one.box or (), other.box or (), strict=True):
        assert np.array_equal(a, b)
    for a, b in zip(one.errors, other.errors, strict=True):
        near = max(np.pi - np.linalg.norm(b), 1e-3)  # of half a turn, where pinocchio's logarithm loses digits
        np.testing.assert_allclose(a, b, rtol=0.0, atol=max(1e-13, 1e-13 / near))
    assert one.result is not None
    assert one.result.status == other.result.status
    np.testing.assert_allclose(one.command, other.command, rtol=0.0, atol=1e-9)
    said = [judged(it, robot.joint_names, one.command) for it in (one, other)]  # type: ignore[arg-type]
    assert said[0] == said[1]
    for (weight, a), (same, b) in zip(one.result.regimes, other.result.regimes, strict=True):
        assert weight == same
        assert (a.status, a.note, a.solver) == (b.status, b.note, b.solver)
        np.testing.assert_allclose(a.residuals, b.residuals, rtol=0.0, atol=1e-9)


@settings(max_examples=some(5, of=12), deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.01, 1.0]))
def test_one_call_is_the_parts_asked_one_by_one(irb140: Any, seed: int, spread: float) -> None:
    for tasks, law, limits in kinds(irb140).values():
        rng = np.random.default_rng(seed)
        state, qd, samples, qd0, activations = draw(rng, irb140, tasks, spread)
        if law.__class__ is not qpsafe.HierarchicalLaw and irb140.nq > 4:
            state = irb140.at(np.where(np.arange(6) == 4, 0.7, state.q))  # pseudoinverses jump where a pose is singular
        resolve = Resolve(irb140, tasks, law, 0.004)
        for _ in range(2):  # nothing of one tick is left in the next
            one = resolve(state, qd, qd, samples, qd0, activations, limits)
        compare(irb140, one, one_by_one(state, qd, tasks, samples, qd0, activations, law, limits))


@settings(max_examples=some(8, of=40), deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.sampled_from([0.01, 1.0]), st.sampled_from([0, 1, 2]), st.sampled_from([0.0, 0.02])
)
def test_built_in_parts_give_the_bits_of_the_law(
    irb140: Any, seed: int, spread: float, bad: int, damping: float
) -> None:
    """Data that are not finite, too: what the law says then is said."""
    rng, tasks = np.random.default_rng(seed), TASKS["position and orientation"]
    law, limits = qpsafe.HierarchicalLaw(damping=damping), qpsafe.JointLimits.of(irb140)
    state, qd, samples, qd0, activations = draw(rng, irb140, tasks, spread)
    if bad == 1:
        samples[0].pose[0, 3] = np.nan
    if bad == 2:
        qd0[2] = np.inf
    one = Resolve(irb140, tasks, law, 0.004)(state, qd, qd, samples, qd0, activations, limits)
    wanted = [task.clik(state, sample) for task, sample in zip(tasks, samples, strict=True)]
    wishes = tuple(TaskVelocity(clik.jacobian, clik.velocity) for clik in wanted)
    assert one.box is not None
    assert one.result is not None
    corrections = tuple(task.gain * clik.error for task, clik in zip(tasks, wanted, strict=True))
    other = law.solve(LawProblem(wishes, qd0, activations, one.box.lower, one.box.upper, (), corrections))
    assert np.array_equal(one.result.qd, other.qd)
    assert np.array_equal(one.command, one.box.clip(other.qd))
    assert one.result.status == other.status
    for (weight, a), (same, b) in zip(one.result.regimes, other.regimes, strict=True):
        assert weight == same
        assert np.array_equal(a.qd, b.qd)
        assert (a.status, a.iterations, a.note, a.solver) == (b.status, b.iterations, b.note, b.solver)
        assert (a.binding, a.pressed_by) == (b.binding, b.pressed_by)
        np.testing.assert_array_equal(a.residuals, b.residuals)
        assert str(a).splitlines()[:-1] == str(b).splitlines()[:-1]


def test_a_task_may_change_its_rows_in_the_middle_of_a_run(irb140: Any, run: Any) -> None:
    class Fading(qpsafe.PositionTask):
        rows_now = 3

        def clik(self, state: Any, sample: Any) -> Any:
            full = super().clik(state, sample)
            return type(full)(*(part[: self.rows_now] for part in full))

    here = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    task = Fading("tcp", here)
    loop = run(tasks=[task, qpsafe.OrientationTask("tcp", here)])
    for count in (3, 2, 1, 0, 3):
        Fading.rows_now = count
        tick = loop.step()
        assert [len(error) for error in tick.errors] == [count, 3]
        assert tick.status == "ok"


def test_answers_of_wrong_shapes_are_faults(irb140: Any, run: Any) -> None:
    class Wrong(qpsafe.PositionTask):
        def jacobian(self, state: Any) -> np.ndarray:
            return super().jacobian(state)[:, :5]

    here = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    tick = run(tasks=[Wrong("tcp", here), qpsafe.OrientationTask("tcp", here)]).step()
    assert tick.status == "fault"
    assert "shape (3, 5), expected (3, 6)" in tick.messages[0]


def test_parts_may_be_exchanged_in_the_middle_of_a_run(run: Any) -> None:
    loop = run()
    assert len(loop.step().law.regimes) > 0
    loop.controller.law = qpsafe.NullspaceLaw()
    assert loop.step().law.regimes == ()
    loop.controller.law = qpsafe.HierarchicalLaw()
    assert len(loop.step().law.regimes) > 0
