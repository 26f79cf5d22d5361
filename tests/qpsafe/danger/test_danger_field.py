"""What `DangerField` takes and returns: configuration, shapes, memory layouts, values that are not finite."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.field import DangerField, danger_vectors
from qpsafe.danger.link_field import danger_field
from qpsafe.errors import ConfigurationError
from qpsafe.robot.wire import Wire

RNG = np.random.default_rng(3)
POINTS, LINKS = RNG.uniform(-2.0, 2.0, (5, 3)), 4
WIRE = Wire(*RNG.normal(size=(4, LINKS, 3)))
NOWHERE = np.empty((0, 3))
BAD = st.sampled_from([np.nan, np.inf, -np.inf])


@pytest.mark.parametrize(
    ("key", "value"),
    [(key, bad) for key in ("static", "kinetic", "gamma", "floor") for bad in (-1.0, np.nan, np.inf, "1", None, True)]
    + [("gamma", 0.999), ("floor", 0.0), ("floor", 10**400)],
)
def test_a_wrong_parameter_is_named_at_construction(key, value):
    with pytest.raises(ConfigurationError) as caught:
        DangerField(**{key: value})
    assert caught.value.key == key
    assert caught.value.value is value


def test_the_public_name_has_the_weights_of_the_source():
    assert qpsafe.DangerField() == DangerField(static=1.0, kinetic=1.0, gamma=1.0, floor=1e-3)


@pytest.mark.parametrize("no_points", [NOWHERE, []])
def test_no_points_have_no_danger(no_points):
    value, gradient = DangerField().evaluate(no_points, WIRE)
    assert (value.shape, gradient.shape) == ((0,), (0, 3))
    assert DangerField().vectors(no_points, WIRE).shape == (0, 3)
    assert DangerField().value(no_points, WIRE, no_points).shape == (0,)


@pytest.mark.parametrize(
    ("field", "wire"),
    [(DangerField(), Wire(*[NOWHERE] * 4)), (DangerField(static=0.0, kinetic=0.0), WIRE)],
    ids=["no links", "no weight"],
)
def test_without_danger_the_vectors_are_zero(field, wire):
    assert not field.value(POINTS, wire).any()
    assert not field.vectors(POINTS, wire).any()


@given(BAD, st.integers(0, len(POINTS) - 1), st.integers(0, 2), st.booleans(), st.sampled_from([0.0, 1.0]))
@settings(deadline=None, max_examples=some(8, of=40))
def test_a_point_that_is_not_finite_has_no_finite_danger_and_spoils_no_other(bad, j, axis, in_velocity, kinetic):
    field, points, velocities = DangerField(kinetic=kinetic), POINTS.copy(), 0.1 * POINTS
    expected = *field.evaluate(points, WIRE, velocities), field.vectors(points, WIRE, velocities)
    (velocities if in_velocity else points)[j, axis] = bad
    result = *field.evaluate(points, WIRE, velocities), field.vectors(points, WIRE, velocities)
    for array, right in zip(result, expected, strict=True):
        assert np.isnan(array[j]).all()
        assert np.array_equal(np.delete(array, j, axis=0), np.delete(right, j, axis=0))


@given(BAD, st.integers(0, 3), st.integers(0, LINKS - 1), st.integers(0, 2), st.booleans(), st.sampled_from([0.0, 1.0]))
@settings(deadline=None, max_examples=some(13, of=80))
def test_a_wire_that_is_not_finite_has_no_finite_danger_anywhere(bad, part, link, axis, no_length, kinetic):
    wire = Wire(*(a.copy() for a in WIRE))
    if no_length:
        wire.ends[link] = wire.starts[link]
    wire[part][link, axis] = bad
    field = DangerField(kinetic=kinetic)
    value, gradient = field.evaluate(POINTS, wire)
    assert np.isnan(value).all()
    assert np.isnan(gradient).all()
    assert np.isnan(field.vectors(POINTS, wire)).all()


@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e-30, 1e30, 1e160, 1e300])
@pytest.mark.parametrize("part", range(5))
def test_huge_and_tiny_numbers_give_a_finite_field_or_all_nan(size, part):
    arrays = [POINTS, *WIRE]
    arrays[part] = size * arrays[part]
    value, gradient = DangerField().evaluate(arrays[0], Wire(*arrays[1:]))
    assert np.array_equal(np.isfinite(gradient).all(axis=1), np.isfinite(value))
    assert np.array_equal(np.isnan(gradient).all(axis=1), np.isnan(value))
    assert not (value < 0.0).any()


@pytest.mark.parametrize("shape", [(3,), (2, 2), (3, 1), (0, 2), (1, 1, 3), ()])
def test_a_wrong_shape_of_points_is_named(shape):
    with pytest.raises(ConfigurationError, match="points"):
        DangerField().evaluate(np.zeros(shape), WIRE)


@pytest.mark.parametrize("part", Wire._fields)
@pytest.mark.parametrize("shape", [(LINKS, 2), (LINKS + 1, 3), (3,)])
def test_a_wrong_shape_in_the_wire_is_named(part, shape):
    with pytest.raises(ConfigurationError, match="wire"):
        DangerField().evaluate(POINTS, WIRE._replace(**{part: np.zeros(shape)}))


def test_velocities_of_other_points_are_refused():
    with pytest.raises(ConfigurationError, match="point_velocities"):
        DangerField().evaluate(POINTS, WIRE, POINTS[:-1])
    with pytest.raises(ConfigurationError, match="gradient"):
        danger_vectors(np.zeros(2), POINTS)


def unaligned(a: np.ndarray) -> np.ndarray:
    return np.frombuffer(b"\0" + a.tobytes(), dtype=np.uint8)[1:].view(float).reshape(a.shape)


def read_only(a: np.ndarray) -> np.ndarray:
    copy = a.copy()
    copy.flags.writeable = False
    return copy


LAYOUTS = {
    "fortran": np.asfortranarray,
    "strided": lambda a: np.repeat(a, 2, axis=0)[::2],
    "reversed": lambda a: a[::-1].copy()[::-1],
    "read-only": read_only,
    "unaligned": unaligned,
    "big-endian": lambda a: a.astype(">f8"),
    "list": np.ndarray.tolist,
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_layout_in_memory_changes_nothing_and_compiles_nothing(layout):
    change = LAYOUTS[layout]
    expected = DangerField().evaluate(POINTS, WIRE, POINTS)
    result = DangerField().evaluate(change(POINTS), Wire(*map(change, WIRE)), change(POINTS))
    assert all(map(np.array_equal, result, expected))
    assert len(danger_field.signatures) == 1


def test_equal_input_gives_equal_bits_in_any_order_and_leaves_the_input_alone():
    copies = POINTS.copy(), Wire(*(a.copy() for a in WIRE))
    first, order = DangerField().evaluate(*copies), RNG.permutation(len(POINTS))
    again, other = DangerField().evaluate(*copies), DangerField().evaluate(POINTS[order], WIRE)
    assert all(map(np.array_equal, first, again))
    assert all(np.array_equal(a[order], b) for a, b in zip(first, other, strict=True))
    assert all(map(np.array_equal, (copies[0], *copies[1]), (POINTS, *WIRE)))


@given(st.floats(1e-300, 1e300), st.floats(0.0, 1e300))
def test_the_vector_of_a_steep_or_flat_field_keeps_its_length(steep, value):
    direction = np.array([[2.0, -3.0, 6.0]]) / 7.0
    expected = value * direction
    assert danger_vectors(np.array([value]), steep * direction) == pytest.approx(expected, rel=1e-13)
