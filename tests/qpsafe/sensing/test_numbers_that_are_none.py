"""Text, truth values, complex and masked numbers are no numbers, wherever places, sizes, angles or joints are given;
whole ones, lists and single precision are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.hulls import Obstacle

ROBOT = qpsafe.load_robot("irb140")
ZONE, POSE = RangeSensor("zone", np.array([[0.0, 0.0, 1.0]]), np.array(0.1)), np.eye(4)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])

#: What takes numbers: what is made of them, numbers that are right, and the name in the error.
TAKES: dict[str, tuple[Callable[[Any], Any], np.ndarray, str]] = {
    "directions": (lambda v: replace(ZONE, directions=v).directions, ZONE.directions, "directions"),
    "half angle": (lambda v: replace(ZONE, half_angle=v).half_angle, np.array(0.0), "half_angle"),
    "sensor's pose": (lambda v: replace(ZONE, pose=v).pose, POSE, "pose"),
    "placed": (lambda v: ZONE.placed(v).pose, POSE, "pose"),
    "vertices": (lambda v: Obstacle("thing", v).vertices, CORNERS, "vertices"),
    "size": (lambda v: Obstacle.box("thing", v).vertices, np.ones(3), "size"),
    "centre": (lambda v: Obstacle.box("thing", np.ones(3), v).vertices, np.ones(3), "centre"),
    "box's pose": (lambda v: Obstacle.box("thing", np.ones(3), pose=v).vertices, POSE, "pose"),
    **{
        f"{name}({key})": (call, np.zeros(6), key)
        for name, key, call in (
            ("at", "q", lambda v: ROBOT.at(v).q),
            ("pose", "q", partial(ROBOT.pose, "tcp")),
            ("jacobian", "q", partial(ROBOT.jacobian, "tcp")),
            ("wire", "q", lambda v: ROBOT.wire(v, np.zeros(6))),
            ("wire", "qd", lambda v: ROBOT.wire(np.zeros(6), v)),
            ("nearest", "goal", lambda v: ROBOT.nearest(v, np.zeros(6))),
            ("nearest", "q", lambda v: ROBOT.nearest(np.zeros(6), v)),
        )
    },
}  # fmt: skip


def masked(values: np.ndarray, where: int) -> np.ndarray:
    """One of the numbers is hidden."""
    return np.ma.array(values, mask=np.arange(values.size).reshape(values.shape) == where % values.size)


NONE: dict[str, Callable[[np.ndarray, int], Any]] = {
    "text": lambda v, _: v.astype(str),
    "text in lists": lambda v, _: v.astype(str).tolist(),
    "bytes": lambda v, _: v.astype(bytes),
    "truth": lambda v, _: v.astype(bool),
    "truth in lists": lambda v, _: v.astype(bool).tolist(),
    "truth beside numbers": lambda v, where: np.where(
        np.arange(v.size).reshape(v.shape) == where % v.size, True, v.astype(object)
    ).tolist(),
    "complex": lambda v, _: v.astype(complex),
    "complex in lists": lambda v, _: v.astype(complex).tolist(),
    "masked": masked,
    "all masked": lambda v, _: np.ma.masked_all(v.shape),
    "objects": lambda v, _: v.astype(object),
    "times": lambda v, _: v.astype("timedelta64[s]"),
    "none": lambda v, _: np.full(v.shape, None).tolist(),
    "too large": lambda v, _: np.full(v.shape, 10**400, dtype=object).tolist(),
}
SOME: dict[str, Callable[[np.ndarray], Any]] = {
    "lists": lambda v: v.tolist(),
    "whole": lambda v: v.astype(int),
    "whole in lists": lambda v: v.astype(int).tolist(),
    "single": lambda v: v.astype(np.float32),
    "Fortran": np.asfortranarray,
    "read-only": lambda v: np.broadcast_to(v, v.shape),
    "masked, nothing hidden": np.ma.array,
}


@settings(max_examples=60)
@given(st.sampled_from(sorted(TAKES)), st.sampled_from(sorted(NONE)), st.integers(0, 99))
def test_what_is_no_number_is_refused_by_name(what: str, kind: str, where: int) -> None:
    make, right, key = TAKES[what]
    with pytest.raises(ConfigurationError) as refused:
        make(NONE[kind](right.astype(float), where))
    assert refused.value.key == key


@settings(max_examples=60)
@given(st.sampled_from(sorted(TAKES)), st.sampled_from(sorted(SOME)))
def test_numbers_of_any_kind_mean_the_same(what: str, kind: str) -> None:
    make, right, _ = TAKES[what]
    np.testing.assert_array_equal(make(SOME[kind](right.astype(float))), make(right.astype(float)))


@settings(max_examples=30)
@given(st.sampled_from(["1", True, 1j, None, [1.0], np.nan, np.inf, 0.0, -1.0, np.ma.masked, 10**400, object()]))
def test_a_scale_that_is_none_and_a_file_that_is_none_are_refused_by_name(value: Any) -> None:
    with pytest.raises(ConfigurationError) as refused:
        Obstacle.mesh("thing", __file__, scale=value)
    assert refused.value.key == "scale"
    if not isinstance(value, str):
        with pytest.raises(ConfigurationError) as refused:
            Obstacle.mesh("thing", value)
        assert refused.value.key == "path"


@settings(max_examples=30)
@given(st.sampled_from([True, np.True_, "8", b"8", 8j, np.ma.masked, None, [8], np.nan, 2.5]))
def test_a_number_of_zones_that_is_none_is_refused_by_name(value: Any) -> None:
    for make, key in (
        (lambda: RangeSensor.array("a", value, 4), "rows, columns"),
        (lambda: RangeSensor.camera("a", (4, value), (9.0, 9.0, 1.0, 1.0)), "shape"),
        (lambda: RangeSensor.planar("a", 0.0, 0.1, value), "count"),
        (lambda: replace(ZONE, shape=(1, value)), "shape"),
    ):
        with pytest.raises(ConfigurationError) as refused:
            make()
        assert refused.value.key == key
