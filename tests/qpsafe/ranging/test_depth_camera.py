"""Depth frames: z along the pixels' rays, and what is not known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.depth_camera import DepthCamera
from qpsafe.ranging.sensor import RangeSensor

SHAPE = (6, 8)
SENSOR = RangeSensor.camera("d", SHAPE, (7.0, 7.5, 3.4, 2.6), range_max=4.0)
DEPTHS = arrays(np.uint16, SHAPE, elements=st.one_of(st.just(0), st.just(65535), st.integers(0, 65535)))


@given(DEPTHS, st.sampled_from([0.001, 0.0001, 0.00025]))
def test_a_pixel_is_a_point_of_the_pinhole_model(depth, scale) -> None:
    """x = (u - cx) z / fx, y = (v - cy) z / fy, z: from the frame itself; 0 and 65535 tell nothing."""
    image = DepthCamera(SENSOR, scale).image(depth, stamp=2.0)
    valid = np.asarray(image.valid).reshape(SHAPE)
    assert np.array_equal(valid, (depth > 0) & (depth < 65535))
    assert np.array_equal(np.isnan(np.asarray(image.distances)), ~valid.ravel())
    points = (np.asarray(image.distances)[:, None] * SENSOR.directions).reshape(*SHAPE, 3)
    v, u = np.indices(SHAPE)
    z = scale * depth
    expected = np.stack(((u - 3.4) * z / 7.0, (v - 2.6) * z / 7.5, z), axis=2)
    assert points[valid] == pytest.approx(expected[valid], rel=1e-9)


@given(DEPTHS)
def test_metres_in_floats_say_the_same(depth) -> None:
    metres = np.where((depth == 0) | (depth == 65535), np.nan, 1e-3 * depth)
    one, other = DepthCamera(SENSOR).image(depth, stamp=0.0), DepthCamera(SENSOR, 1.0).image(metres, stamp=0.0)
    assert np.array_equal(one.valid, other.valid)
    assert np.asarray(one.distances) == pytest.approx(np.asarray(other.distances), nan_ok=True)


def test_infinities_of_float_frames() -> None:
    frame = np.full(SHAPE, 1.0)
    frame.flat[:5] = -np.inf, np.inf, np.nan, 0.0, -1.0
    image = DepthCamera(SENSOR, 1.0).image(frame, stamp=0.0)
    assert np.asarray(image.valid)[:5].tolist() == [True, True, False, False, False]
    assert np.asarray(image.distances)[0] == 0.0
    assert np.asarray(image.distances)[1] == np.inf


def test_noise_grows_with_the_square_of_z() -> None:
    camera = DepthCamera(SENSOR, sigma_1m=0.002)
    for z in (500, 1000, 3000):
        image = camera.image(np.full(SHAPE, z, dtype=np.uint16), stamp=0.0)
        sigma_z = np.asarray(image.sigma) * SENSOR.directions[:, 2]
        assert sigma_z == pytest.approx(0.002 * (z / 1000) ** 2)


@pytest.mark.parametrize(
    "depth", [None, [], np.ones((8, 6)), np.ones(47), "frame", np.full(SHAPE, 1j), np.full((6, 8, 3), 9)]
)
def test_a_frame_of_another_form_tells_nothing(depth) -> None:
    image = DepthCamera(SENSOR).image(depth, stamp=1.0)
    assert not np.asarray(image.valid).any()
    assert np.isnan(image.distances).all()


def test_mistakes_are_named() -> None:
    with pytest.raises(ConfigurationError, match="z > 0"):
        DepthCamera(RangeSensor.planar("p", -3.0, 0.1, 60))
    for option in ({"scale": 0.0}, {"scale": np.nan}, {"sigma_1m": -1.0}):
        with pytest.raises(ConfigurationError, match=next(iter(option))):
            DepthCamera(SENSOR, **option)
