"""Compiled stages of the tick against their equations one by one in NumPy."""

from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.field import DangerField
from qpsafe.danger.push import push_vectors
from qpsafe.robot.wire import Wire
from qpsafe.sensing.detection import nearest_link

seeds = st.integers(0, 2**32 - 1)


class Own(DangerField):
    """A field of another class, so that nothing is taken for granted about it."""


def pushed(robot: Any, state: Any, wire: Wire, points: np.ndarray, links: np.ndarray, field: DangerField) -> Any:
    """Values, vectors, torque and CDF_n by the compiled stage."""
    values, vectors = field.evaluate(points, wire)
    torque = np.empty(robot.nq)
    cdf_n = push_vectors(values, links, state.memory, robot.ends, *robot.wire_indices, vectors, torque)
    return values, vectors, torque, cdf_n


@settings(max_examples=some(10, of=60), deadline=None)
@given(seeds, st.integers(0, 25))
def test_push_is_its_equations(irb140: Any, seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    state = irb140.at(rng.uniform(irb140.lower, irb140.upper))
    wire = state.wire(rng.normal(size=6) * rng.integers(0, 2))
    points, links = rng.uniform(-1.0, 1.0, (count, 3)), rng.integers(0, 6, count)
    field = DangerField(*rng.uniform(0.0, 2.0, 2).tolist())
    values, vectors, torque, cdf_n = pushed(irb140, state, wire, points, links, field)
    assert cdf_n == values.max(initial=0.0)
    expected, gradient = field.evaluate(points, wire)
    assert np.array_equal(values, expected)
    for vector, value, slope in zip(vectors, values, gradient, strict=True):  # (6)
        assert vector == pytest.approx(value * slope / np.linalg.norm(slope), rel=1e-12)

    expected = np.zeros(6)  # (8), (14), (15) with the Jacobians of the frames
    for link, (start, end) in enumerate(irb140.wire_frames):
        force = vectors[links == link].sum(axis=0)
        expected += (state.jacobian(start) + state.jacobian(end))[:3].T @ force
    assert np.abs(torque - expected).max() <= 1e-12 * (1.0 + np.abs(vectors).sum())


@pytest.mark.parametrize("field", [DangerField(), DangerField(floor=1e-300)])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_said_in_cdf_n(irb140: Any, field: DangerField, bad: float) -> None:
    state = irb140.at(irb140.home)
    wire, links = state.wire(np.ones(6)), np.array([0, 5, 2])
    points = np.array([[0.5, 0.2, 0.3], [bad, 0.1, 0.2], [0.4, 0.3, 0.1]])
    assert np.isnan(pushed(irb140, state, wire, points, links, field)[3])
    if field.floor < 1e-100:  # finite dangers with an infinite sum
        on = np.tile(wire.ends[4], (12, 1))
        values, _, torque, cdf_n = pushed(irb140, state, wire, on, np.full(12, 4), field)
        assert np.isnan(cdf_n) or (np.isfinite(values).all() and np.isfinite(torque).all())


def nearest_by_numpy(points: np.ndarray, wire: Wire) -> np.ndarray:
    along = wire.ends - wire.starts
    length2 = np.maximum(np.sum(along**2, axis=1), 1e-300)
    offset = points[:, None, :] - wire.starts
    t = np.clip(np.sum(offset * along, axis=2) / length2, 0.0, 1.0)
    distance2 = np.sum((offset - t[..., None] * along) ** 2, axis=2)
    return np.argmax(distance2 <= (1.0 + 1e-9) * np.min(distance2, axis=1, keepdims=True) + 1e-18, axis=1)


@settings(max_examples=some(10, of=60), deadline=None)
@given(seeds)
def test_the_nearest_link_and_of_equals_the_first(irb140: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    wire = irb140.wire(rng.uniform(irb140.lower, irb140.upper), np.zeros(6))
    shares = rng.choice([0.0, 1.0, 0.3, -0.5, 2.0], (30, 1))
    i = rng.integers(0, 6, 30)
    on_and_beyond = wire.starts[i] + shares * (wire.ends - wire.starts)[i]  # ends are shared: ties
    points = np.vstack((on_and_beyond, rng.uniform(-1.0, 1.0, (30, 3))))
    assert nearest_link(points, wire).tolist() == nearest_by_numpy(points, wire).tolist()


def test_a_field_of_another_making_still_drives_the_robot(run: Any, irb140: Any) -> None:
    plain, own = run(), run(field=Own())
    tip = irb140.pose("tcp", irb140.home)[:3, 3]
    for k in range(60):
        point = tip[None] + [0.3 - 0.003 * k, 0.02, 0.0]
        one, other = plain.step(point), own.step(point)
        assert one.cdf_n == pytest.approx(other.cdf_n, rel=1e-9)
        assert one.reference.qd == pytest.approx(other.reference.qd, abs=1e-9)


class Evade(qpsafe.OrientationTask):
    """Redefines one method only: the compiled shortcut of its parent must not be taken."""

    def error(self, value: np.ndarray, sample: Any) -> np.ndarray:
        return super().error(value, sample) + 0.01


def test_a_task_that_redefines_a_method_is_asked(irb140: Any) -> None:
    goal = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    state, task = irb140.at(irb140.home), Evade("tcp", goal)
    clik = task.clik(state, goal.sample(0.0))
    assert clik.error == pytest.approx([0.01] * 3)
    assert clik.velocity == pytest.approx([0.1] * 3)
