"""Mistakes in what describes a sensor: each is a named error, whatever was given; copies are as good as the first."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.separation import Separation
from qpsafe.errors import ConfigurationError
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.ranging.adapters.depth_camera import DepthCamera
from qpsafe.ranging.adapters.laser_scan import LaserScanner
from qpsafe.ranging.adapters.vl53l5cx import Vl53l5cx, vl53l5cx
from qpsafe.ranging.reduction.reduce import tiled
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import RangeSensor

ARRAY = RangeSensor.array("array")


class Scan:
    """As ROS has it."""

    def __init__(self, **fields: Any) -> None:
        usual = {"angle_min": -1.0, "angle_increment": 0.1, "range_min": 0.1, "range_max": 9.0, "ranges": [1.0] * 20}
        self.__dict__.update(usual | fields)


#: What makes something of one value, by name; the values that are right.
MADE: dict[str, tuple[Callable[[Any], Any], tuple[Any, ...]]] = {
    **{
        f"RangeSensor.{key}": (lambda value, key=key: replace(ARRAY, **{key: value}), right)
        for key, right in {
            "shape": ((8, 8), [4, 16], np.array([2, 32]), (0, 0)), "covers": (True, False), "period": (0.1, 1),
            "range_max": (3, np.float32(2.0)), "range_min": (0, 0.5), "sigma": (0, np.float64(1.0)),
            "pose": (np.eye(4),), "max_age": (None, 2), "name": ("other",), "half_angle": (0.1, np.full(64, 0.1)),
        }.items()
    },
    "rows": (lambda value: RangeSensor.array("a", value, 4), (4, 4.0, np.int64(3))),
    "field of view": (lambda value: RangeSensor.array("a", 2, 2, value), (1, 0.5)),
    "camera's shape": (lambda value: RangeSensor.camera("a", value, (50, 50, 3, 3)), ((6, 8), [6, 8])),
    "intrinsics": (lambda value: RangeSensor.camera("a", (6, 8), value), ((50, 50, 3, 3), np.full(4, 50.0))),
    "first angle": (lambda value: RangeSensor.planar("a", value, 0.1, 9), (0, -1.5)),
    "increment": (lambda value: RangeSensor.planar("a", 0.0, value, 9), (0.1, -0.1)),
    "rays": (lambda value: RangeSensor.planar("a", 0.0, 0.1, value), (9, np.int64(9))),
    "placed": (ARRAY.placed, (np.eye(4), np.eye(4).tolist())),
    "DepthCamera": (DepthCamera, (ARRAY,)),
    "DepthCamera.scale": (lambda value: DepthCamera(ARRAY, value), (1, 0.001)),
    "DepthCamera.sigma_1m": (lambda value: DepthCamera(ARRAY, 1.0, value), (None, 0, 0.1)),
    "LaserScanner": (LaserScanner, (ARRAY,)),
    "LaserScanner.range_min": (lambda value: LaserScanner(ARRAY, value), (None, 0, 0.1)),
    "LaserScanner.range_max": (lambda value: LaserScanner(ARRAY, 0.1, value), (None, 2)),
    **{
        f"LaserScanner.of.{key}": (lambda value, key=key: LaserScanner.of("s", Scan(**{key: value})), right)
        for key, right in {
            "angle_min": (0, -1.0), "angle_increment": (0.1,), "range_min": (0.1,), "range_max": (9,),
            "ranges": ([1.0], np.ones(5)), "scan_time": (0.0, 0.1),
        }.items()
    },
    "Vl53l5cx": (Vl53l5cx, (ARRAY,)),
    "Vl53l5cx.order": (lambda value: Vl53l5cx(ARRAY, value), ("driver", "scene")),
    "Vl53l5cx.along": (lambda value: Vl53l5cx(ARRAY, along=value), ("axis", "ray")),
    "Vl53l5cx.valid": (lambda value: Vl53l5cx(ARRAY, valid=value), ((5, 9), [5], {5, 6})),
    "zones": (lambda value: vl53l5cx("a", value), (4, 8)),
    **{
        f"RangeRules.{key}": (lambda value, key=key: RangeRules(**{key: value}), right)
        for key, right in {
            "each": (1, 9), "support": (1, 4), "reach": (0, 1.0), "unseen": ("free", "occupied"), "predict": (True,),
        }.items()
    },
    "Separation": (lambda value: Separation(2.0, value), (0, 1.6)),
    "Separation.deceleration": (Separation, (1, 2.0)),
    "VerifiedMotion": (VerifiedMotion, (1, 1.6)),
    "load_range_sensors.robot": (qpsafe.load_range_sensors, ("irb140",)),
    "load_range_sensors.sensors": (lambda value: qpsafe.load_range_sensors("irb140", value), ("vl53l5cx",)),
    "load_cell": (qpsafe.load_cell, ()),
    "load_cameras": (qpsafe.load_cameras, ()),
}  # fmt: skip
ODD = [
    None, "x", b"x", -1, 0, 2.5, 10**400, float("nan"), float("inf"), -float("inf"), 1e300, True, [], (), [1],
    ["a", "b"], (8, 8), (-8, -8), (2.5, 25.6), (np.nan, 8), {}, {5}, 1j, np.array([1.0, 2.0]), np.zeros((0, 3)),
    np.eye(4) * 2, np.full((4, 4), np.nan), np.array("x"), object(), np.datetime64("now"), range(3), print,
]  # fmt: skip


@pytest.mark.parametrize("what", MADE)
def test_whatever_is_given_is_taken_or_a_named_error(what: str) -> None:
    make, right = MADE[what]
    for value in right:
        make(value)
    refused = 0
    for value in ODD:
        try:
            make(value)
        except ConfigurationError:  # anything else fails here
            refused += 1
    assert refused > len(ODD) // 2


@pytest.mark.parametrize("shape", [(2.5, 25.6), (-8, -8), (64, 1.5), (8, 9), None, "ab", (8, 8, 1)])
def test_a_shape_has_as_many_zones_as_there_are(shape: Any) -> None:
    with pytest.raises(ConfigurationError, match="shape"):
        replace(ARRAY, shape=shape)


@settings(max_examples=some(4, of=10))
@given(st.integers(0, 2**32 - 1))
def test_zones_without_order_are_not_taken_for_tiles(seed: int) -> None:
    """Their cones would be as wide as the image, and hide everybody near the robot."""
    camera = RangeSensor.camera("camera", (60, 80), (57.0, 57.0, 39.5, 29.5))
    sensor, size = tiled(camera, 1000)
    assert size == (3, 3)
    assert np.degrees(sensor.half_angle.max()) < 5.0
    mixed = np.random.default_rng(seed).permutation(len(camera))
    with pytest.raises(ConfigurationError, match="side by side"):
        tiled(replace(camera, directions=camera.directions[mixed], shape=(0, 0)), 1000)


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing)), replace])
def test_a_copied_sensor_is_the_same_and_stays_so(way: Callable[[Any], Any]) -> None:
    other = way(ARRAY)
    assert other.same_zones(ARRAY)
    for key in ("directions", "half_angle", "pose"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(other, key)[:] = 0.0


@given(st.floats(1e-3, 1.0), st.floats(1e-3, 1.0), st.none() | st.floats(1e-3, 3.0))
def test_another_period_is_another_patience_unless_that_was_given(
    first: float, second: float, age: float | None
) -> None:
    changed = replace(replace(ARRAY, period=first, max_age=age), period=second)
    assert changed.patience == (3.0 * second if age is None else age)
    assert changed.max_age == age
