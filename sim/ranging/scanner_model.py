"""A planar scanner as it is: noise, lost rays, the fields of a ROS LaserScan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.laser_scan import LaserScanner
from qpsafe.ranging.sensor import RangeImage, RangeSensor

Array = NDArray[np.float64]


class Scan(NamedTuple):
    """The fields of a ROS LaserScan that count."""

    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: NDArray[np.float32]


@dataclass(frozen=True)
class ScannerModel:
    """Figures of a scanner, chosen by us, see `RangingModel`.

    Attributes:
        sigma: Standard deviation of a range [m].
        lost: Probability that a ray is lost, and NaN.
        latency: From the middle of the scan until it is there [s].
        cones: See `RangingModel`: a beam is narrow.
    """

    sigma: float = 0.01
    lost: float = 0.002
    latency: float = 0.03
    cones: bool = False

    def __post_init__(self) -> None:
        for key in ("sigma", "latency"):
            if not 0.0 <= getattr(self, key) < np.inf:
                raise ConfigurationError("ScannerModel", key, getattr(self, key), "a finite number >= 0")
        if not 0.0 <= self.lost <= 1.0:
            raise ConfigurationError("ScannerModel", "lost", self.lost, "a probability")

    def reach(self, sensor: RangeSensor) -> float:
        """As far as the sensor looks."""
        return sensor.range_max

    def unit(self, sensor: RangeSensor, rng: np.random.Generator) -> ScannerUnit:
        """One scanner; they are alike."""
        return ScannerUnit(sensor, self)


class ScannerUnit:
    """One scanner.

    Args:
        sensor: From `RangeSensor.planar`.
        model: Its kind.
    """

    def __init__(self, sensor: RangeSensor, model: ScannerModel) -> None:
        self._adapter, self._model, self._sensor = LaserScanner(sensor), model, sensor
        first, second = (np.arctan2(d[1], d[0]) for d in sensor.directions[[0, min(1, len(sensor) - 1)]])
        self._angles = float(first), float(np.remainder(second - first + np.pi, 2.0 * np.pi) - np.pi)

    def scan(self, distances: Array, rng: np.random.Generator) -> Scan:
        """A message of true distances (z,) [m]: -inf too near, +inf nothing, NaN lost.

        Args:
            distances: Along the rays.
            rng: Of noise.
        """
        model, sensor = self._model, self._sensor
        told = distances + model.sigma * rng.normal(size=len(distances))
        told[told < sensor.range_min] = -np.inf
        told[told > sensor.range_max] = np.inf
        told[rng.random(len(distances)) < model.lost] = np.nan
        return Scan(*self._angles, sensor.range_min, sensor.range_max, told.astype(np.float32))

    def image(self, distances: Array, stamp: float, rng: np.random.Generator) -> RangeImage:
        """An image of true distances, through a scan and `LaserScanner`.

        Args:
            distances: Along the rays (z,) [m].
            stamp: When it was taken [s].
            rng: Of noise.
        """
        return self._adapter.image(self.scan(distances, rng), stamp=stamp)
