"""Scans: REP 117, what lies outside a scanner's range, messages of ROS."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.laser_scan import LaserScanner
from qpsafe.ranging.sensor import RangeSensor

RAYS = 90


def message(ranges, **fields):
    """As of `sensor_msgs/LaserScan`, in its 32 bits."""
    known = {"angle_min": -1.5, "angle_increment": 3.0 / (RAYS - 1), "range_min": 0.05, "range_max": 12.0}
    known = {key: float(np.float32(value)) for key, value in known.items()} | {"scan_time": 0.04}
    stamp = SimpleNamespace(sec=12, nanosec=250_000_000)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp), ranges=np.asarray(ranges, np.float32), intensities=[], **(known | fields)
    )


SCANNER = LaserScanner.of("front", message(np.ones(RAYS)), mount="world", range_max=4.0)
ODD = st.sampled_from([np.inf, -np.inf, np.nan, 0.0, -1.0, 0.02, 0.05, 12.0, 12.5])


@given(arrays(np.float32, RAYS, elements=st.one_of(ODD, st.floats(0.0625, 12.0, width=32))))
def test_what_each_number_says(ranges) -> None:
    """An oracle in plain Python, ray by ray."""
    image = SCANNER.image(message(ranges))
    for raw, distance, valid in zip(ranges, np.asarray(image.distances), np.asarray(image.valid), strict=True):
        if raw == -np.inf:
            expected = 0.0  # as near as can be
        elif raw == np.inf or 0.0 < raw <= 12.0:
            expected = float(raw)
        else:
            expected = np.nan
        assert valid == (not np.isnan(expected))
        assert distance == pytest.approx(expected, nan_ok=True)
    assert image.stamp == pytest.approx(12.25)


@given(arrays(np.float64, RAYS, elements=st.floats(0.06, 11.0)))
def test_points_lie_at_the_messages_angles(ranges) -> None:
    scan = message(ranges)
    image = SCANNER.image(scan)
    points = np.asarray(image.distances)[:, None] * SCANNER.sensor.directions
    angles = scan.angle_min + scan.angle_increment * np.arange(RAYS)
    assert np.arctan2(points[:, 1], points[:, 0]) == pytest.approx(angles, abs=1e-6)
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(ranges, rel=1e-6)


def test_ranges_alone_and_their_own_stamp() -> None:
    scanner = LaserScanner(RangeSensor.planar("p", 0.0, 0.02, RAYS, range_min=0.1, range_max=3.0))
    image = scanner.image([0.5] * RAYS, stamp=7.0)
    assert image.stamp == 7.0
    assert np.asarray(image.distances) == pytest.approx(0.5)
    assert np.isnan(scanner.image([0.5] * RAYS).stamp)  # no message, no stamp: it will be refused
    older = SimpleNamespace(ranges=[0.5] * RAYS, header=SimpleNamespace(stamp=SimpleNamespace(to_sec=lambda: 3.5)))
    assert scanner.image(older).stamp == 3.5


def test_a_scan_at_other_angles_tells_nothing() -> None:
    """A scanner that was turned over, or set to another resolution, since its sensor was described."""
    for field, value in (("angle_min", -1.4), ("angle_increment", 0.02), ("angle_increment", None)):
        image = SCANNER.image(message(np.ones(RAYS), **{field: value}))
        assert not np.asarray(image.valid).any()


@pytest.mark.parametrize("ranges", [None, [], [1.0] * 89, "far", np.ones((RAYS, 2)), [None] * RAYS])
def test_a_scan_of_another_form_tells_nothing(ranges) -> None:
    image = SCANNER.image(ranges, stamp=0.0)
    assert not np.asarray(image.valid).any()


def test_a_scanner_is_described_by_its_message() -> None:
    sensor = SCANNER.sensor
    assert (len(sensor), sensor.range_max, sensor.period) == (RAYS, 4.0, 0.04)
    assert SCANNER.range_max == pytest.approx(12.0)
    far = LaserScanner.of("far", message(np.ones(RAYS), range_max=80.0, scan_time=0.0))
    assert far.sensor.range_max == 25.0
    with pytest.raises(ConfigurationError, match="angle_increment"):
        LaserScanner.of("x", SimpleNamespace(angle_min=0.0))
    with pytest.raises(ConfigurationError, match="range_max"):
        LaserScanner(sensor, range_min=2.0, range_max=1.0)


class Raises:
    """A message of another making: whatever it is asked raises."""

    def __init__(self, error: type[Exception]) -> None:
        self._error = error

    def __array__(self, *_: object, **__: object) -> object:
        raise self._error

    def to_sec(self) -> float:
        raise self._error


@pytest.mark.parametrize("error", [RuntimeError, OverflowError, ZeroDivisionError, KeyError])
def test_scans_that_raise_tell_nothing(error: type[Exception]) -> None:
    scanner = LaserScanner(RangeSensor.planar("scanner", -1.0, 0.1, 20))
    usual = {"angle_min": -1.0, "angle_increment": 0.1, "ranges": np.ones(20)}
    assert not np.any(scanner.image(Raises(error), stamp=0.0).valid)
    assert not np.any(scanner.image(SimpleNamespace(**usual | {"ranges": Raises(error)}), stamp=0.0).valid)
    assert not np.any(scanner.image(SimpleNamespace(**usual | {"angle_min": 10**400}), stamp=0.0).valid)
    header = SimpleNamespace(stamp=Raises(error))
    assert np.isnan(scanner.image(SimpleNamespace(**usual, header=header)).stamp)


@pytest.mark.parametrize("rays", [9, 90, 361, 720])
@pytest.mark.parametrize("turns", [0.25, 1.0, 1.7])
def test_a_scan_of_other_angles_tells_nothing_and_whole_turns_do_not_matter(rays: int, turns: float) -> None:
    """Mirrored, begun elsewhere, or wider: also where first, middle and last ray look the same way."""
    begin, step = -np.pi * turns, 2.0 * np.pi * turns / (rays - 1)
    scanner = LaserScanner.of("round", message(np.ones(rays), angle_min=begin, angle_increment=step), mount="world")
    looks = np.exp(1j * (begin + step * np.arange(rays)))
    others = [(begin + dx, factor * step) for dx in (0.0, 2 * np.pi, 0.3) for factor in (1.0, -1.0, 3.0, 0.5)]
    for first, each in [*others, (-begin, -step), (begin, step + 2.0 * np.pi)]:
        image = scanner.image(message(np.ones(rays), angle_min=first, angle_increment=each))
        same = np.abs(np.exp(1j * (first + each * np.arange(rays))) - looks).max() < 1e-6
        assert np.asarray(image.valid).all() == same
        assert np.asarray(image.valid).any() == same


@pytest.mark.parametrize("increment", [0.0, -0.0, 1e-9, -1e-300, np.nan])
def test_rays_that_coincide_are_refused(increment: float) -> None:
    assert len(RangeSensor.planar("one", 0.3, 0.0, 1)) == 1
    with pytest.raises(ConfigurationError, match="increment"):
        RangeSensor.planar("many", 0.3, increment, 181)
    with pytest.raises(ConfigurationError, match="increment"):
        LaserScanner.of("many", message(np.ones(RAYS), angle_increment=increment), mount="world")
