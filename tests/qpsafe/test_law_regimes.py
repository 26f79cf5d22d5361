"""Tasks, limits and law in one compiled call against the same one after the other: equal bits, and the same story."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.resolve import Resolver, judged, resolve
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


@pytest.mark.parametrize("key", TASKS)
@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.sampled_from([0.01, 1.0]), st.sampled_from([0.0, 0.02]), st.sampled_from([0, 0, 1, 2])
)
def test_one_call_is_all_of_them(irb140: Any, key: str, seed: int, spread: float, damping: float, bad: int) -> None:
    rng, tasks, robot = np.random.default_rng(seed), TASKS[key], irb140
    law = qpsafe.HierarchicalLaw(damping=damping)
    limits = qpsafe.JointLimits(robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration)
    assert Resolver.fits(tasks, law, limits)
    state, qd, samples, qd0, activations = draw(rng, robot, tasks, spread)
    if bad == 1:
        samples[0].pose[0, 3] = np.nan
    if bad == 2:
        qd0[2] = np.inf
    one = Resolver(robot, tasks, law, limits)(state, qd, samples, qd0, activations)
    assert one is not None
    box = limits.box(state.q, qd)
    other = resolve(state, tasks, samples, qd0, activations, law, box, (), limits.dt)

    for a, b in zip(one.box, other.box, strict=True):
        assert np.array_equal(a, b)
    for a, b in zip(one.errors, other.errors, strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.array_equal(one.command, other.command)
    assert np.array_equal(one.result.qd, other.result.qd)
    np.testing.assert_array_equal(one.excess, other.excess)
    assert judged(one, robot.joint_names) == judged(other, robot.joint_names)
    assert one.result.status == other.result.status
    for (weight, a), (same, b) in zip(one.result.regimes, other.result.regimes, strict=True):
        assert weight == same
        assert np.array_equal(a.qd, b.qd)
        assert (a.status, a.iterations, a.note, a.solver) == (b.status, b.iterations, b.note, b.solver)
        assert (a.binding, a.pressed_by) == (b.binding, b.pressed_by)
        np.testing.assert_array_equal(a.residuals, b.residuals)
        assert str(a).splitlines()[:-1] == str(b).splitlines()[:-1]


def resolver(controller: qpsafe.SafetyController) -> Resolver | None:
    return controller._quick.resolver(controller.tasks, controller.law, controller.limits)


class Slow(qpsafe.PositionTask):
    """Redefines a method."""

    def velocity(self, error: np.ndarray, sample: Any) -> np.ndarray:
        return 0.5 * super().velocity(error, sample)


def test_what_is_not_built_in_goes_one_after_the_other(irb140: Any, run: Any) -> None:
    tasks, law = TASKS["one"], qpsafe.HierarchicalLaw()
    bounds = irb140.lower, irb140.upper, irb140.max_velocity, irb140.max_acceleration
    limits = qpsafe.JointLimits(*bounds)
    here = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    for other in (
        ([Slow("tcp", here)], law, limits),
        ([qpsafe.OrientationTask("tcp", here, form="euler")], law, limits),
        ([qpsafe.PostureTask(irb140.home)], law, limits),
        (tasks, qpsafe.WeightedLaw(), limits),
        (tasks, qpsafe.HierarchicalLaw(solver="daqp"), limits),
        (TASKS["three"], qpsafe.HierarchicalLaw("paper"), limits),
        (tasks, law, None),
        (tasks, law, qpsafe.JointLimits(*bounds, max_jerk=np.full(6, 500.0))),
    ):
        assert not Resolver.fits(*other)
    # and in the middle of a run, parts may be exchanged
    loop = run()
    loop.step()
    assert resolver(loop.controller) is not None
    loop.controller.law = qpsafe.NullspaceLaw()
    assert loop.step().law.regimes == ()
    assert resolver(loop.controller) is None
