"""From an image to the few points of it that matter: tables of one sensor, tiles of dense images, the compiled call."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.reduction.looking_kernel import AROUND
from qpsafe.ranging.reduction.reduce_kernel import SHOWN, farthest_zone, reduce_zones, tile, tile_sigma
from qpsafe.ranging.tracking.velocities import MOST

if TYPE_CHECKING:
    from qpsafe.ranging.judge import Usable
    from qpsafe.ranging.rules import RangeRules
    from qpsafe.ranging.sensor import RangeSensor
    from qpsafe.robot.wire import Wire
    from qpsafe.sensing.hulls import HullSet
    from qpsafe.sensing.rules import SensingRules

Array = NDArray[np.float64]


class Shown(NamedTuple):
    """What an image shows, in numbers of zones.

    Attributes:
        valid: That tell anything.
        hits: That see something within the sensor's range.
        own: That see the robot itself.
        known: That see known obstacles.
        expected: Of those that were asked, that known things fill.
        through: Of these, that see through what is there.
        impossible: That read less than nothing.
        seen: Whose points count.
        sparse: Of how many points there is a choice, see `Reducer.sparse`.
    """

    valid: int
    hits: int
    own: int
    known: int
    expected: int
    through: int
    impossible: int
    seen: int
    sparse: int


def tiled(sensor: RangeSensor, most: int) -> tuple[RangeSensor, tuple[int, int]]:
    """A sensor whose zones are tiles of another one's, and how many pixels its tiles are high and wide, at least.

    Tiles are about as high as wide, as angles go: a camera's are square, those of a scanner do not join its layers.
    Pixels that are left over at the end are shared out, so that no tile is smaller than the others.

    Args:
        sensor: Of many zones in rows and columns.
        most: How many zones it may have.

    Raises:
        ConfigurationError: What stands side by side in rows and columns does not look side by side.
    """
    rows, columns = sensor.shape
    grid = sensor.directions.reshape(rows, columns, 3)
    high, wide = _tile_size(grid, most)
    if high == wide == 1:
        return sensor, (1, 1)
    pitch = sensor.half_angle.reshape(rows, columns)
    down, across = rows // high, columns // wide
    tops, lefts = np.arange(down + 1) * rows // down, np.arange(across + 1) * columns // across
    directions, angles = [], []
    for top, bottom in pairwise(tops.tolist()):
        for left, right in pairwise(lefts.tolist()):
            part = grid[top:bottom, left:right].reshape(-1, 3)
            middle = part.mean(axis=0)
            middle /= np.linalg.norm(middle)
            directions.append(middle)
            cone = pitch[top:bottom, left:right].ravel()
            angles.append(float((np.arccos(np.clip(part @ middle, -1.0, 1.0)) + cone).max()))
    # half the diagonal of a square that is its share of a full sphere is 2.5 / sqrt(n)
    if not max(angles) < min(5.0 * 2.5 / len(angles) ** 0.5 + float(pitch.max()), 0.25 * np.pi):
        expected = f"rows and columns whose neighbours look side by side, as of all sensors of more than {most} zones"
        raise ConfigurationError(f"RangeSensor {sensor.name!r}", "shape", sensor.shape, expected)
    zones = replace(sensor, directions=np.array(directions), half_angle=np.array(angles), shape=(down, across))
    return zones, (high, wide)


def _tile_size(grid: Array, most: int) -> tuple[int, int]:
    """How many pixels high and wide tiles are, so that a grid of directions (rows, columns, 3) has at most so many."""
    shape, pitch, size = grid.shape[:2], [], [1, 1]
    for axis in (0, 1):
        apart = np.linalg.norm(np.diff(grid, axis=axis), axis=-1)
        pitch.append(max(float(np.median(apart)), 1e-9) if apart.size else np.inf)
    while (shape[0] // size[0]) * (shape[1] // size[1]) > most:
        # as large as one pixel more makes them where that is least; those of a single row are as high as that
        angle = min((size[i] + 1) * pitch[i] for i in (0, 1) if size[i] < shape[i])
        size = [min(max(math.ceil(angle / pitch[i] - 1e-9), 1), shape[i]) for i in (0, 1)]
    return size[0], size[1]


def view_of(directions: Array) -> tuple[float, ...]:
    """The middle of all directions (z, 3), then cosine and sine of the cone around it that holds them."""
    middle = directions.mean(axis=0)
    size = float(np.linalg.norm(middle))
    if size < 1e-3:  # all around
        return 1.0, 0.0, 0.0, -1.0, 0.0
    middle /= size
    cosine = float(np.clip((directions @ middle).min(initial=1.0), -1.0, 1.0))
    return *middle.tolist(), cosine, float(np.sqrt(1.0 - cosine * cosine))


class Reducer:
    """Reduces the images of one sensor.

    Args:
        sensor: The sensor.
        rules: Numbers for images.
        sensing: Tolerances.
        hulls: The robot itself and known obstacles.
        links: How many links the robot's wire has.

    Attributes:
        zones: The sensor, or its tiles.
        distances, valid, sigma: Of the zones of the last image (z,).
        found: All points of the last image that count, as many as it was told to show (z, 4).
        kept: What the last image left, at least as many rows as `reduce` told, see `reduce_zones`.
        sparse: Places of the points that the last image left, then of others that count, evenly chosen [m].
    """

    def __init__(
        self, sensor: RangeSensor, rules: RangeRules, sensing: SensingRules, hulls: HullSet, links: int
    ) -> None:
        self.zones, size = tiled(sensor, rules.dense)
        count = len(self.zones)
        self._slants = np.tan(self.zones.half_angle)
        self._numbers = np.array([
            sensor.range_min, sensor.range_max, sensing.tolerance, rules.spread, rules.reach, rules.deviations,
            *view_of(self.zones.directions),
        ])  # fmt: skip
        self._tables, self._each = hulls.tables, rules.each
        self._tiled, self._support = self.zones is not sensor, min(rules.support, *size)  # what one row sees counts
        self._stride = farthest_zone(count)
        self.found = np.empty((count, 4))
        things = len(hulls.tables[0])
        self._work = (
            self.found, np.empty((links, count)), np.empty(count, dtype=np.int64),
            np.empty((things, AROUND)), np.empty((2, things), dtype=np.int64),
        )  # fmt: skip
        self._tiles = np.empty(count), np.empty(count, dtype=np.bool_)
        self.distances, self.valid, self.sigma = np.empty(count), np.zeros(count, dtype=np.bool_), np.empty(count)
        self.kept = np.empty((links * rules.each, 4))
        self.sparse = np.empty((max(MOST, len(self.kept) + 1), 3))
        self._shown = np.zeros(SHOWN, dtype=np.int64)

    def __call__(self, image: Usable, pose: Array, then: Array, wire: Wire, carrier: int) -> tuple[int, Shown]:
        """Reduce an image: how many points `kept` holds now, and what the image shows.

        Args:
            image: Whose arrays fit.
            pose: Of the sensor when it was taken (4, 4).
            then: Poses of the robot's bodies when it was taken (b, 4, 4).
            wire: The robot's, now.
            carrier: The robot's body that the sensor sits on; -1 for none.
        """
        distances, valid, sigma = image.distances, image.valid, image.sigma
        if self._tiled:
            shape, tiles, (nearest, known) = image.shape, self.zones.shape, self._tiles
            tile(distances.reshape(shape), valid.reshape(shape), *tiles, self._support, nearest, known)
            if sigma.strides[0] == 0:  # one number
                sigma = np.full(len(nearest), sigma[0])
            else:
                spread, sigma = sigma.reshape(shape), np.empty(len(nearest))
                tile_sigma(distances.reshape(shape), valid.reshape(shape), spread, *tiles, nearest, sigma)
            distances, valid = nearest, known
        self.distances, self.valid, self.sigma = distances, valid, sigma
        count = reduce_zones(
            distances, sigma, valid, self.zones.directions, self._slants, pose, self._numbers,
            wire.starts, wire.ends, then, *self._tables, *self._work, carrier, self._each, self._stride, self.kept,
            self.sparse, self._shown,
        )  # fmt: skip
        return count, Shown(*self._shown.tolist())
