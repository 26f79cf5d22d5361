"""What must hold for the danger field whatever the robot does: symmetries, scaling, convexity, its sign, its floor."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import some
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from qpsafe.danger.field import DangerField
from qpsafe.robot.wire import Wire

FIELD = DangerField(floor=1e-6)
STATIC = DangerField(kinetic=0.0, floor=1e-6)
MOTION = DangerField(static=0.0, floor=1e-6)
CLEARANCE = 0.01  # [m] of the points from the links, where a law is tested relative to the size of the field

number = st.sampled_from([0.0, 0.5, -1.0]) | st.floats(-2.0, 2.0).map(lambda x: round(x, 6))  # degenerate cases often
vector = st.tuples(number, number, number).map(np.array)
unit = vector.filter(lambda x: np.linalg.norm(x) > 0.1).map(lambda x: x / np.linalg.norm(x))
many = settings(deadline=None, max_examples=some(8, of=50))


@st.composite
def wires(draw, links: int | None = None) -> Wire:
    n = draw(st.integers(1, 4)) if links is None else links
    starts, ends, start_velocities, end_velocities = (np.array([draw(vector) for _ in range(n)]) for _ in range(4))
    for i in range(n):
        match draw(st.sampled_from(["free", "free", "no length", "one velocity", "opposite velocities"])):
            case "no length":
                ends[i] = starts[i]
            case "one velocity":
                end_velocities[i] = start_velocities[i]
            case "opposite velocities":
                end_velocities[i] = -start_velocities[i]
    return Wire(starts, ends, start_velocities, end_velocities)


@st.composite
def scenes(draw, links: int | None = None) -> tuple[np.ndarray, Wire]:
    """Points (p, 3) clear of the links, and a wire."""
    wire = draw(wires(links))
    points = np.array(draw(st.lists(vector, min_size=1, max_size=4)))
    assume(clearance(points, wire).min() > CLEARANCE)
    return points, wire


def nearest(points: np.ndarray, wire: Wire) -> np.ndarray:
    """Nearest point of every link to every point, (p, links, 3)."""
    d = wire.ends - wire.starts
    square = np.where((d * d).sum(1) > 0, (d * d).sum(1), 1.0)
    l = np.clip(((points[:, None] - wire.starts) * d).sum(2) / square, 0.0, 1.0)
    return wire.starts + l[..., None] * d


def clearance(points: np.ndarray, wire: Wire) -> np.ndarray:
    return np.linalg.norm(points[:, None] - nearest(points, wire), axis=2).min(axis=1)


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def assert_same(result, expected, size: tuple, factor: float = 1.0) -> None:
    """Equal to rounding, beside the size of the unfactored field: its value, and value / distance for the gradient."""
    value, gradient = result
    scale, distance = size
    assert np.all(np.abs(value - expected[0]) <= 1e-10 * scale * factor)
    assert np.all(np.linalg.norm(gradient - expected[1], axis=1) <= 1e-8 * scale / distance * factor)


def size(points: np.ndarray, wire: Wire) -> tuple[np.ndarray, np.ndarray]:
    return FIELD.value(points, wire), clearance(points, wire)


@many
@given(scenes(), unit, st.floats(-4.0, 4.0), vector)
def test_moving_world_and_robot_together_moves_the_field(scene, axis, angle, shift):
    points, wire = scene
    R = rotation(axis, angle)
    moved = Wire(
        wire.starts @ R.T + shift, wire.ends @ R.T + shift, wire.start_velocities @ R.T, wire.end_velocities @ R.T
    )
    value, gradient = FIELD.evaluate(points, wire)
    assert_same(FIELD.evaluate(points @ R.T + shift, moved), (value, gradient @ R.T), size(points, wire))


@many
@given(scenes())
def test_the_field_of_a_robot_is_the_sum_over_its_links(scene):
    points, wire = scene
    parts = [FIELD.evaluate(points, Wire(*(a[i : i + 1] for a in wire))) for i in range(len(wire.starts))]
    expected = sum(v for v, _ in parts), sum(g for _, g in parts)
    assert_same(FIELD.evaluate(points, wire), expected, size(points, wire))


@many
@given(scenes(), st.sampled_from([0.5, 0.25, 0.9]))
def test_the_field_of_a_link_is_the_weighted_mean_of_its_parts(scene, l):
    # l in (4) is a fraction of the link, not arc length: the parts count with their share of it
    points, wire = scene
    middle, velocity = (a + l * (b - a) for a, b in (wire[:2], wire[2:]))
    first = FIELD.evaluate(points, Wire(wire.starts, middle, wire.start_velocities, velocity))
    second = FIELD.evaluate(points, Wire(middle, wire.ends, velocity, wire.end_velocities))
    expected = tuple(l * a + (1 - l) * b for a, b in zip(first, second, strict=True))
    assert_same(FIELD.evaluate(points, wire), expected, size(points, wire))


@many
@given(scenes())
def test_a_link_has_no_direction(scene):
    points, wire = scene
    reverse = Wire(wire.ends, wire.starts, wire.end_velocities, wire.start_velocities)
    assert_same(FIELD.evaluate(points, reverse), FIELD.evaluate(points, wire), size(points, wire))


@many
@given(scenes(), st.sampled_from([1e-3, 0.3, 7.0, 1e3]))
def test_a_robot_twice_as_large_and_fast_has_half_the_field(scene, s):
    points, wire = scene
    value, gradient = FIELD.evaluate(points, wire)
    scaled = DangerField(floor=s * FIELD.floor).evaluate(s * points, Wire(*(s * a for a in wire)))
    assert_same((scaled[0] * s, scaled[1] * s * s), (value, gradient), size(points, wire))


@many
@given(scenes(), st.sampled_from([0.0, 1e-9, 0.3, 1e6]))
def test_the_kinetic_field_grows_in_proportion_to_the_velocities(scene, s):
    points, wire = scene
    faster = Wire(wire.starts, wire.ends, s * wire.start_velocities, s * wire.end_velocities)
    expected = tuple(s * a for a in MOTION.evaluate(points, wire))
    assert_same(MOTION.evaluate(points, faster), expected, size(points, wire), factor=s)


@many
@given(scenes(), st.lists(vector, min_size=8, max_size=8), st.floats(0.0, 1.0))
def test_the_kinetic_field_is_convex_in_the_velocities(scene, others, l):
    points, wire = scene
    n = len(wire.starts)
    other = wire._replace(start_velocities=np.array(others[:n]), end_velocities=np.array(others[4 : 4 + n]))
    mixed = Wire(*((1 - l) * a + l * b for a, b in zip(wire, other, strict=True)))
    chord = (1 - l) * MOTION.value(points, wire) + l * MOTION.value(points, other)
    assert np.all(MOTION.value(points, mixed) <= chord * (1 + 1e-9) + 1e-9)


@many
@given(scenes(), vector)
def test_only_the_velocity_relative_to_the_point_counts(scene, velocity):
    points, wire = scene
    seen = wire._replace(
        start_velocities=wire.start_velocities - velocity, end_velocities=wire.end_velocities - velocity
    )
    moving = FIELD.evaluate(points, wire, np.tile(velocity, (len(points), 1)))
    assert_same(moving, FIELD.evaluate(points, seen), size(points, seen))


@many
@given(scenes(), st.tuples(*[st.floats(0.0, 3.0)] * 2), st.floats(1.0, 3.0))
def test_the_weights_weight_the_three_parts(scene, weights, gamma):
    points, wire = scene
    (k1, k2), parts = weights, [STATIC, MOTION, DangerField(static=0.0, gamma=2.0, floor=1e-6)]
    S, one, two = (field.evaluate(points, wire) for field in parts)
    expected = tuple(k1 * s + k2 * (a + (gamma - 1) * (b - a)) for s, a, b in zip(S, one, two, strict=True))
    result = DangerField(k1, k2, gamma, floor=1e-6).evaluate(points, wire)
    assert_same(result, expected, size(points, wire), factor=30.0)


@many
@given(scenes())
def test_the_gradient_is_the_derivative_of_the_value(scene):
    points, wire = scene
    value, distance = size(points, wire)
    step = 1e-3 * distance
    _, gradient = FIELD.evaluate(points, wire)
    for axis in range(3):
        h = np.zeros_like(points)
        h[:, axis] = step
        f = [FIELD.value(points + k * h, wire) for k in (-2, -1, 1, 2)]
        difference = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)  # exact to the fifth derivative
        assert np.all(np.abs(difference - gradient[:, axis]) <= 1e-9 * value / distance)


@many
@given(scenes())
def test_the_static_field_is_harmonic_off_the_links(scene):
    points, wire = scene
    value, distance = STATIC.value(points, wire), clearance(points, wire)
    step, divergence = 1e-3 * distance, np.zeros(len(points))
    for axis in range(3):
        h = np.zeros_like(points)
        h[:, axis] = step
        g = [STATIC.evaluate(points + k * h, wire)[1][:, axis] for k in (-2, -1, 1, 2)]
        divergence += (g[0] - 8 * g[1] + 8 * g[2] - g[3]) / (12 * step)
    assert np.all(np.abs(divergence) <= 1e-8 * value / distance**2)


@many
@given(wires(), st.lists(vector, min_size=1, max_size=5), st.floats(1.0, 2.0))
def test_the_field_is_finite_and_never_negative(wire, points, gamma):
    points = np.array([*points, wire.starts[0], wire.ends[-1], 0.3 * wire.starts[0] + 0.7 * wire.ends[0]])
    for field in (DangerField(gamma=gamma), MOTION):
        value, gradient = field.evaluate(points, wire)
        assert np.all(value >= 0.0)
        assert np.all(value < np.inf)
        assert np.all(np.isfinite(gradient))


@many
@given(scenes(links=1), st.floats(1.001, 10.0))
def test_the_static_field_falls_along_the_way_from_the_link(scene, factor):
    points, wire = scene
    near = nearest(points, wire)[:, 0]
    value, gradient = STATIC.evaluate(points, wire)
    assert np.all(STATIC.value(near + factor * (points - near), wire) < value)
    assert np.all(((points - near) * gradient).sum(axis=1) < 0.0)


@many
@given(scenes(links=1), st.floats(1.001, 10.0))
def test_the_whole_field_of_a_point_robot_falls_along_the_way_from_it(scene, factor):
    points, wire = scene
    point = wire._replace(ends=wire.starts)
    assume(clearance(points, point).min() > CLEARANCE)
    assert np.all(FIELD.value(wire.starts + factor * (points - wire.starts), point) < FIELD.value(points, point))


@pytest.mark.parametrize(("cosine", "share"), [(1.0, 2.0), (0.0, 1.0), (-1.0, 0.0)])
def test_a_point_robot_is_the_elementary_field_of_the_source(cosine, share):
    # (1) and (2): 1/R + |v| (1 + cos)/R² with R = 0.5, |v| = 3
    v = 3.0 * np.array([[cosine, np.sqrt(1.0 - cosine**2), 0.0]])
    value = DangerField().value([[0.5, 0.0, 0.0]], Wire(np.zeros((1, 3)), np.zeros((1, 3)), v, v))
    assert value == pytest.approx(2.0 + 12.0 * share, rel=1e-13)


@many
@given(scenes(links=1), st.floats(1e-6, 0.999))
def test_within_the_floor_the_field_is_that_at_the_floor(scene, depth):
    points, wire = scene
    near, floor = nearest(points, wire)[:, 0], 0.02
    out = (points - near) / np.linalg.norm(points - near, axis=1)[:, None]
    at_floor = FIELD.evaluate(near + floor * out, wire)
    length = np.linalg.norm(wire.ends - wire.starts)
    tolerance = 1e-9 + 1e-14 * (1 + length) / (depth * floor)  # the direction out is known no better
    value, gradient = DangerField(floor=floor).evaluate(near + depth * floor * out, wire)
    assert np.all(np.abs(value - at_floor[0]) <= tolerance * at_floor[0])
    error = np.linalg.norm(gradient - at_floor[1], axis=1)
    assert np.all(error <= 10 * tolerance * at_floor[0] / floor)


@many
@given(wires(links=1), st.sampled_from([0.0, 0.25, 0.5, 1.0]))
def test_on_the_link_the_point_counts_as_on_the_side_that_the_link_moves_to(wire, l):
    point = wire.starts + l * (wire.ends - wire.starts)
    length = np.linalg.norm(wire.ends - wire.starts)
    l = l if length > 0 else 0.5  # a link of length zero moves with its mean velocity
    velocity = (1 - l) * wire.start_velocities + l * wire.end_velocities
    if length > 0:
        u = (wire.ends - wire.starts) / length
        velocity = velocity - (velocity * u).sum() * u
    assume((length == 0 or length > 0.1) and np.linalg.norm(velocity) > 1e-3)
    field = DangerField(floor=0.01)
    ahead = field.value(point + 0.01 * velocity / np.linalg.norm(velocity), wire)
    assert field.value(point, wire) == pytest.approx(ahead, rel=1e-9)


@many
@given(scenes())
def test_the_vector_field_has_the_size_of_the_field_and_the_direction_of_its_gradient(scene):
    points, wire = scene
    value, gradient = FIELD.evaluate(points, wire)
    vectors = FIELD.vectors(points, wire)
    steep = np.linalg.norm(gradient, axis=1)
    assert np.linalg.norm(vectors, axis=1) == pytest.approx(np.where(steep > 0, value, 0.0), rel=1e-13)
    assert np.all(np.abs(vectors * steep[:, None] - gradient * value[:, None]) <= 1e-13 * (value * steep)[:, None])
