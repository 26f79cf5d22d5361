"""The first half of a tick in one compiled call against its steps one after the other, over bad sequences."""

import copy
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.evasion import Evasion, link_vectors, virtual_torque
from qpsafe.danger.field import DangerField, danger_vectors
from qpsafe.pipeline.sense import Seen, Sense
from qpsafe.sensing.detection import BadInput, nearest_link
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing

FLOOR = Obstacle.box("floor", (6, 6, 0.5), (0, 0, -0.4))


class OwnField(DangerField):
    """A field of another class, so that it is asked method by method."""


class OwnEvasion(Evasion):
    """Likewise."""


def tried(call: Any) -> Any:
    try:
        return call()
    except BadInput as problem:
        return str(problem)


def steps(robot: Any, q: Any, qd: Any, field: Any, evasion: Any, points: Any, links: Any, velocities: Any) -> Seen:
    """From points to q̇0 by public functions, an equation each."""
    state = robot.at(q)
    wire = state.wire(qd)
    danger, gradient = field.evaluate(points, wire, velocities)  # (1)-(5)
    vectors = danger_vectors(danger, gradient)  # (6)
    torque = virtual_torque(state, link_vectors(vectors, links, len(wire.starts)))  # (8), (14), (15)
    if not (np.isfinite(danger).all() and np.isfinite(torque).all()):
        raise BadInput("the danger of a detected point is not finite")
    return Seen(points, links, danger, vectors, danger.max(initial=0.0), evasion.step(torque))  # (16)


def compare(one: Any, other: Any) -> None:
    if isinstance(other, str) or isinstance(one, str):
        assert str(one).startswith(str(other)), (one, other)
        return
    for key in ("points", "links", "danger", "vectors"):
        assert np.array_equal(getattr(one, key), getattr(other, key)), key
    assert one.cdf_n == other.cdf_n
    scale = 1.0 + np.abs(one.vectors).sum()
    assert np.abs(one.qd0 - other.qd0).max() <= 1e-12 * scale


@pytest.mark.parametrize("ours", [True, False])
@settings(max_examples=some(8, of=20), deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([0.0, 0.02, 0.3]), st.booleans())
def test_readings(irb140: Any, ours: bool, seed: int, velocities: bool, sick: float, aged: bool) -> None:
    rng, spots = np.random.default_rng(seed), qpsafe.load_spots(irb140)
    rules = SensingRules(velocities=velocities, dead_after=0.02)
    sensing = DistanceSensing(irb140, spots, 0.004, rules, (FLOOR,))
    weights = rng.uniform(0.0, 2.0, 2).tolist()
    field = (DangerField if ours else OwnField)(*weights)
    evasion = (Evasion if ours else OwnEvasion)(4.0, 20.0, 6)
    sense = Sense(irb140, sensing, field, evasion)
    other_sensing, other_evasion = copy.deepcopy((sensing, evasion))
    q, distances = irb140.home + rng.normal(0.0, 0.3, 6), rng.uniform(0.1, 1.4, len(spots))

    def step_by_step(qd: Any, readings: Any, ages: Any) -> Seen:
        state = irb140.at(q)
        seen = other_sensing.update(state, state.wire(qd), readings, ages)
        if seen.too_many:
            raise BadInput("; ".join(seen.notes))
        return steps(irb140, q, qd, field, other_evasion, seen.points, seen.links, seen.velocities)

    for _ in range(25):
        qd = rng.normal(0.0, 0.5, 6)
        q, distances = q + 0.004 * qd, distances + rng.normal(0.0, 0.01, len(spots))
        readings = np.where(rng.random(len(spots)) < sick, rng.choice([np.nan, np.inf, -1.0, 0.0]), distances)
        ages = rng.uniform(0.0, 0.06, len(spots)) if aged else None
        given_readings = readings.tolist() if rng.random() < 0.2 else readings
        compare(
            tried(lambda: sense(q, qd, given_readings, None, ages)),  # noqa: B023  called at once
            tried(lambda: step_by_step(qd, readings, ages)),  # noqa: B023
        )
        assert np.abs(evasion.velocity - other_evasion.velocity).max() <= 1e-12 * (1.0 + np.abs(evasion.velocity).max())
        assert np.array_equal(sensing.counted, other_sensing.counted)
        assert sensing.health.severity == other_sensing.health.severity


@pytest.mark.parametrize("ours", [True, False])
@settings(max_examples=some(8, of=20), deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["", "NaN", "far", "strided", "read-only", "list", "float32"]))
def test_points(irb140: Any, ours: bool, seed: int, what: str) -> None:
    rng = np.random.default_rng(seed)
    field = (DangerField if ours else OwnField)(*rng.uniform(0.0, 2.0, 2).tolist())
    evasion = Evasion(4.0, 20.0, 6)
    sense, other_evasion, q = Sense(irb140, None, field, evasion), copy.deepcopy(evasion), irb140.home.copy()
    for tick in range(10):
        qd = rng.normal(0.0, 0.5, 6)
        q = q + 0.004 * qd
        points: Any = rng.normal(0.0, 1.0, (rng.integers(0, 30), 3))
        if tick == 7 and len(points):
            points[-1, 2] = {"NaN": np.nan, "far": 1e308}.get(what, points[-1, 2])
        if what == "float32":
            points = points.astype(np.float32)
        plain = np.array(points, dtype=float)
        if what == "strided":
            points = np.asfortranarray(points)
        points.flags.writeable = what != "read-only"
        handed = points.tolist() if what == "list" else points
        one = tried(lambda: sense(q, qd, None, handed, None))  # noqa: B023  called at once
        if not np.isfinite(plain).all():
            assert one.startswith("points are not finite: number")
            continue
        links = nearest_link(plain, irb140.wire(q, qd))
        other = tried(lambda: steps(irb140, q, qd, field, other_evasion, plain, links, None))  # noqa: B023
        compare(one, other)
        assert isinstance(one, str) or not np.shares_memory(one.points, points)  # they go into the tick
        assert np.array_equal(np.asarray(points, dtype=float), plain)


@pytest.mark.parametrize("what", ["q", "qd", "short", "absurd", "shape", "ages", "points", "both", "neither", "old"])
def test_what_cannot_be_used_touches_nothing(irb140: Any, what: str) -> None:
    spots = qpsafe.load_spots(irb140)
    sensing, evasion = DistanceSensing(irb140, spots, 0.004), Evasion(4.0, 20.0, 6)
    sense = Sense(irb140, sensing, DangerField(), evasion)
    q, qd, distances = irb140.home.copy(), np.zeros(6), np.full(len(spots), 0.3)
    q[2] = np.nan if what == "q" else q[2]
    qd[5] = np.inf if what == "qd" else 0.0
    q[0] = 90.0 if what == "absurd" else q[0]
    before = copy.deepcopy(sensing.memory)
    given_q = q[:5] if what == "shape" else q
    readings: Any = distances[1:] if what == "short" else None if what in ("points", "neither", "old") else distances
    points = np.ones((2, 2)) if what == "points" else np.ones((2, 3)) if what in ("both", "old") else None
    with pytest.raises(BadInput):
        sense(given_q, qd, readings, points, np.zeros(3) if what == "ages" else 5.0 if what == "old" else None)
    assert not evasion.velocity.any()
    for now, then in zip(sensing.memory, before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_blocks_hold_what_they_were_made_of(irb140: Any) -> None:
    from qpsafe.pipeline import sense_kernel as kernel

    fields = {name: np.arange(10.0 + k) for k, name in enumerate(kernel.FLOATS)}
    whole = {name: np.arange(3 + k) for k, name in enumerate(kernel.INTEGERS)}
    floats, integers = kernel.pack((1, 2, 3, 4, 5, 6, 7), fields, whole)
    assert integers[:7].tolist() == [1, 2, 3, 4, 5, 6, 7]
    for name, value in (fields | whole).items():
        block = floats if name in fields else integers
        key = {"links": "SPOT_LINKS"}.get(name, name.upper())
        start = integers[getattr(kernel, key)]
        assert np.array_equal(block[start : start + len(value)], value), name
