"""Frames of a VL53L5CX: what each status says, where each zone looks, how far along it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.vl53l5cx import Vl53l5cx, vl53l5cx
from qpsafe.ranging.sensor import RangeSensor

EIGHT, FOUR = vl53l5cx("a"), vl53l5cx("b", zones=4)
STATUSES = st.sampled_from([*range(14), 255])


def one_zone(distances, statuses, number=None, **options):
    """The zone at the top right, which is the frame's first, of a frame that is the same in all zones."""
    adapter = Vl53l5cx(FOUR, **options)
    image = adapter.image(
        np.tile(distances, 16), np.tile(statuses, 16), stamp=0.0,
        nb_target_detected=None if number is None else [number] * 16,
    )  # fmt: skip
    assert len(set(np.asarray(image.valid).tolist())) == 1
    return float(np.asarray(image.distances)[3] * FOUR.directions[3, 2]), bool(np.asarray(image.valid)[3])


@pytest.mark.parametrize("status", [*range(14), 255])
def test_each_status_alone(status: int) -> None:
    distance, valid = one_zone([1500], [status])
    if status in (5, 9):
        assert valid
        assert distance == pytest.approx(1.5)
    elif status == 255:
        assert valid
        assert distance == np.inf
    else:
        assert not valid
        assert np.isnan(distance)


@given(st.lists(st.tuples(st.integers(0, 4000), STATUSES), min_size=1, max_size=4), st.integers(0, 4), st.booleans())
def test_the_nearest_valid_target_counts_and_nothing_is_free_unless_it_is_said(targets, number, told) -> None:
    """An oracle in plain Python."""
    number = min(number, len(targets))
    there = targets[:number] if told else targets
    ranges = [d for d, status in there if status in (5, 9)]
    free = all(status == 255 for _, status in targets) and (number == 0 or not told)
    distance, valid = one_zone(*zip(*targets, strict=True), number if told else None)
    assert valid == (bool(ranges) or free)
    if ranges:
        assert distance == pytest.approx(min(ranges) / 1000)
    elif free:
        assert distance == np.inf
    else:
        assert np.isnan(distance)


@given(arrays(np.int16, (64, 3), elements=st.integers(1, 3999)), st.permutations(range(3)))
def test_the_order_of_targets_does_not_matter(distances, order) -> None:
    adapter, status = Vl53l5cx(EIGHT), np.full((64, 3), 5)
    one, other = (
        adapter.image(d, status, stamp=1.0, range_sigma_mm=d // 50) for d in (distances, distances[:, list(order)])
    )
    assert np.array_equal(one.distances, other.distances)
    assert np.array_equal(one.sigma, other.sigma)


@pytest.mark.parametrize("sensor", [EIGHT, FOUR])
def test_a_wall_that_the_sensor_faces_reads_the_same_in_all_zones(sensor: RangeSensor) -> None:
    """Points of a frame that is 1 m everywhere lie in the plane z = 1 m."""
    n = len(sensor)
    image = Vl53l5cx(sensor).image(np.full(n, 1000), np.full(n, 5), stamp=0.0)
    points = np.asarray(image.distances)[:, None] * sensor.directions
    assert points[:, 2] == pytest.approx(1.0)
    along = Vl53l5cx(sensor, along="ray").image(np.full(n, 1000), np.full(n, 5), stamp=0.0)
    assert np.asarray(along.distances) == pytest.approx(1.0)


def test_the_lens_turns_the_image_over() -> None:
    """Zone 0 looks up (-y) and to the right (+x), the last one down and to the left; "scene" is left as it is."""
    frame = np.arange(64) + 1000
    scale = 1000 * EIGHT.directions[:, 2]
    turned = np.asarray(Vl53l5cx(EIGHT).image(frame, np.full(64, 5), stamp=0.0).distances) * scale
    first, last = (EIGHT.directions[int(np.abs(turned - value).argmin())] for value in (1000, 1063))
    assert first[0] > 0.3
    assert first[1] < -0.3
    assert last == pytest.approx(first * [-1.0, -1.0, 1.0])
    kept = np.asarray(Vl53l5cx(EIGHT, order="scene").image(frame, np.full(64, 5), stamp=0.0).distances) * scale
    assert kept == pytest.approx(frame)
    assert turned.reshape(8, 8) == pytest.approx(kept.reshape(8, 8)[:, ::-1])


@given(arrays(np.uint16, 64, elements=st.integers(0, 500)), arrays(np.uint8, 64, elements=STATUSES))
def test_a_sigma_is_that_of_the_target_and_never_none_at_all(sigma, status) -> None:
    image = Vl53l5cx(EIGHT, order="scene", along="ray").image(np.full(64, 800), status, stamp=0.0, range_sigma_mm=sigma)
    seen = np.isin(status, (5, 9))
    assert np.asarray(image.sigma)[seen] == pytest.approx(np.maximum(sigma[seen], 1) / 1000)
    assert np.asarray(image.sigma)[~seen] == pytest.approx(EIGHT.sigma)


WRONG = [
    ([], []), (np.zeros(63), np.full(63, 5)), (np.zeros(64), np.full(128, 5)), (None, None), ("1 m", 5),
    ([[1], [1, 2]], [5, 5]), (np.full(64, 1j), np.full(64, 5)), (np.zeros(64), [None] * 64),
]  # fmt: skip


@pytest.mark.parametrize(("distance", "status"), WRONG)
def test_a_frame_of_another_form_tells_nothing(distance, status) -> None:
    image = Vl53l5cx(EIGHT).image(distance, status, stamp=3.0)
    assert not np.asarray(image.valid).any()
    assert np.isnan(image.distances).all()
    assert image.stamp == 3.0
    few = Vl53l5cx(EIGHT).image(np.full(64, 700), np.full(64, 5), stamp=3.0, nb_target_detected=[1, 2])
    assert not np.asarray(few.valid).any()


@given(arrays(np.float64, 64, elements=st.floats(allow_nan=True, allow_infinity=True)))
def test_numbers_that_are_none_are_never_a_distance(distance) -> None:
    image = Vl53l5cx(EIGHT, order="scene").image(distance, np.full(64, 5), stamp=0.0)
    assert np.array_equal(np.asarray(image.valid), np.isfinite(distance))
    assert (np.asarray(image.distances)[np.asarray(image.valid)] >= 0.0).all()


def test_mistakes_are_named() -> None:
    with pytest.raises(ConfigurationError, match="zones"):
        vl53l5cx("a", zones=16)
    with pytest.raises(ConfigurationError, match="4x4 or 8x8"):
        Vl53l5cx(RangeSensor.planar("p", 0.0, 0.1, 64))
    for option in ({"order": "mirror"}, {"along": "z"}, {"valid": (5, 255)}):
        with pytest.raises(ConfigurationError, match=next(iter(option))):
            Vl53l5cx(EIGHT, **option)


@pytest.mark.parametrize(
    "sigma", [np.full(63, 150), np.full(128, 150), "150", ["150"] * 64, [None] * 64, 150, np.ma.masked_all(64)]
)
def test_sigmas_that_are_none_make_a_frame_tell_nothing(sigma) -> None:
    """They may have been large: the sensor's own in their place would be too sure."""
    adapter = Vl53l5cx(EIGHT)
    frame = {"distance_mm": np.full(64, 1000), "target_status": np.full(64, 5), "stamp": 0.0}
    assert np.asarray(adapter.image(**frame).valid).all()
    assert np.asarray(adapter.image(**frame, range_sigma_mm=np.full(64, 150)).valid).all()
    assert not np.asarray(adapter.image(**frame, range_sigma_mm=sigma).valid).any()
