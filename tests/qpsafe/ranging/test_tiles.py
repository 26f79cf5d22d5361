"""Images of many zones, in tiles: what a row or a column of pixels sees is seen, wherever it lies; a pixel's noise is
not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.ranging.judge import Usable
from qpsafe.ranging.reduction.reduce import Reducer, tiled
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.body import surrounding_hulls
from qpsafe.sensing.rules import SensingRules

quick = settings(max_examples=some(30, of=300))
supports = st.integers(1, 4)


def layers(rows: int, columns: int, down: float, across: float, **parts: Any) -> RangeSensor:
    """A scanner of several layers, an angle apart, whose rays are another one apart [rad]."""
    elevation = down * (np.arange(rows) - 0.5 * (rows - 1))
    angle = across * (np.arange(columns) - 0.5 * (columns - 1))
    y, x = np.meshgrid(elevation, angle, indexing="ij")
    axes = np.stack((np.cos(y) * np.sin(x), np.sin(y), np.cos(y) * np.cos(x)), axis=-1).reshape(-1, 3)
    return RangeSensor("layers", axes, np.array(0.5 * max(down, across)), shape=(rows, columns), **parts)


@st.composite
def sensors(draw: st.DrawFn) -> RangeSensor:
    """Cameras, scanners of one layer and of several, of any pitch: at least 65 zones."""
    kind = draw(st.sampled_from(["camera", "planar", "layers"]))
    rows, columns = draw(st.integers(1, 40)), draw(st.integers(65, 300))
    if draw(st.booleans()):
        rows, columns = columns, rows
    if kind == "planar":
        count = max(rows, columns)
        return RangeSensor.planar("planar", draw(st.floats(-3.0, 3.0)), draw(st.floats(1e-4, 6.0 / count)), count)
    if kind == "layers":
        down, across = (draw(st.floats(1e-3, min(2.0 / count, 0.5))) for count in (rows, columns))
        return layers(rows, columns, down, across)
    return camera(rows, columns, draw(st.floats(0.1, 10.0)))


def camera(rows: int, columns: int, ratio: float) -> RangeSensor:
    """A camera whose pixels are by so much wider than high."""
    focal = 0.8 * max(rows, columns)
    middle = (0.5 * (columns - 1), 0.5 * (rows - 1))
    return RangeSensor.camera("camera", (rows, columns), (focal, ratio * focal, *middle))


@pytest.fixture(scope="module")
def reduce(irb140: Any) -> Any:
    """Reduces an image of a sensor: what its tiles read, and whether they know anything, both as rows of tiles."""
    hulls, wire, poses = (
        surrounding_hulls(irb140, False, [], None),
        irb140.wire(irb140.home, np.zeros(6)),
        np.eye(4)[None],
    )

    def make(sensor: RangeSensor, rules: RangeRules, read: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        reducer = Reducer(sensor, rules, SensingRules(), hulls, len(irb140.wire_frames))
        valid, sigma = np.ones(len(sensor), bool), np.zeros(len(sensor))
        reducer(Usable(read.reshape(-1), valid, sigma, 0.0, sensor.shape), np.eye(4), poses, wire, -1)
        shape = reducer.zones.shape
        return reducer.distances.reshape(shape), reducer.valid.reshape(shape)

    return make


@quick
@given(st.data(), sensors(), st.integers(64, 400), supports)
def test_what_a_row_or_a_column_sees_is_seen_all_along_it(
    reduce: Any, data: st.DataObject, sensor: RangeSensor, dense: int, support: int
) -> None:
    rules = RangeRules(dense=dense, support=support)
    for axis, count in enumerate(sensor.shape):
        which = data.draw(st.sampled_from([0, count - 1]) | st.integers(0, count - 1))
        read = np.full(sensor.shape, np.inf)
        read[(which, slice(None)) if axis == 0 else (slice(None), which)] = 0.8
        distances, valid = reduce(sensor, rules, read)
        assert distances.size <= max(dense, 1)
        assert valid.all()
        seen = np.isfinite(distances)
        assert (seen.sum(axis=axis) == 1).all()  # of the tiles along it every one, and none beside
        assert (distances[seen] == 0.8).all()


@quick
@given(st.data(), st.integers(9, 60), st.integers(9, 60), st.floats(0.55, 1.8), supports.filter(lambda n: n > 1))
def test_a_pixel_alone_in_a_camera_is_noise(
    reduce: Any, data: st.DataObject, rows: int, columns: int, ratio: float, support: int
) -> None:
    sensor, rules = camera(rows, columns, ratio), RangeRules(dense=64, support=support)
    read = np.full(sensor.shape, data.draw(st.sampled_from([2.0, np.inf])))
    read[data.draw(st.integers(0, rows - 1)), data.draw(st.integers(0, columns - 1))] = 0.8
    distances, _ = reduce(sensor, rules, read)
    assert (distances == read.max()).all()


@pytest.mark.long
@quick
@given(sensors(), st.integers(64, 400))
def test_every_pixel_lies_in_the_cone_of_a_tile_and_layers_stay_apart(sensor: RangeSensor, dense: int) -> None:
    tiles, (high, wide) = tiled(sensor, dense)
    rows, columns = sensor.shape
    assert len(tiles) == (rows // high) * (columns // wide) <= dense or tiles is sensor
    cosines = sensor.directions @ tiles.directions.T
    assert (np.arccos(np.clip(cosines.T, -1.0, 1.0)) <= tiles.half_angle[:, None] + 1e-7).any(axis=0).all()
    grid = sensor.directions.reshape(rows, columns, 3)
    down, across = (np.median(np.linalg.norm(np.diff(grid, axis=axis), axis=-1)) if n > 1 else np.inf
                    for axis, n in enumerate(sensor.shape))  # fmt: skip
    if high > 1:  # no higher than it is wide, but for a pixel
        assert (high - 1) * down <= wide * across * (1.0 + 1e-6) or wide == columns
    if wide > 1:
        assert (wide - 1) * across <= high * down * (1.0 + 1e-6) or high == rows


#: The robot seen from 1.7 m in front of it, by what looks along z, and along x.
ALONG_Z = np.array([[0.0, 0.0, -1.0, 1.7], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.6], [0.0, 0.0, 0.0, 1.0]])
ALONG_X = np.array([[-1.0, 0.0, 0.0, 1.7], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.7], [0.0, 0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("sensor", "where"),
    [
        *((layers(3, 2000, 0.03, 3e-4, pose=ALONG_Z), np.s_[row, 800:1200]) for row in range(3)),
        (RangeSensor.planar("planar", -np.pi, 2.0 * np.pi / 7200, 7200, pose=ALONG_X), np.s_[0, 3580:3620]),
        (RangeSensor.camera("camera", (81, 81), (135, 135, 40, 40), pose=ALONG_Z), np.s_[20:60, 80]),
        (RangeSensor.camera("camera", (81, 81), (135, 135, 40, 40), pose=ALONG_Z), np.s_[80, 20:60]),
    ],
)
def test_somebody_whom_one_layer_or_the_last_column_sees_counts(run: Any, sensor: RangeSensor, where: Any) -> None:
    loop, read = run(spots="off", range_sensors=[sensor]), np.full(sensor.shape, np.inf)
    read[where] = 0.8
    tick = loop.feed(loop.q, loop.qd, images=[sensor.image(read, stamp=0.0)], now=0.004)
    assert tick.status == "ok"
    assert len(tick.near) > 0
