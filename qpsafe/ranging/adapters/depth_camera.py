"""Depth images as images of a range sensor: from z to distances along the pixels' rays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.raw import check_sensor, numbers, says_nothing
from qpsafe.ranging.given import is_number
from qpsafe.ranging.sensor import RangeImage, RangeSensor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DepthCamera:
    """Makes images of depth frames.

    Whole numbers times `scale` are z [m]; 0 is what the camera could not see, and so is the largest number of the
    type, where converters stop: both tell nothing. Fractional numbers are z times `scale` as well, where -inf is too
    near to be measured, and counts as nearest, +inf is nothing, and NaN tells nothing (REP 118, REP 117).

    Attributes:
        sensor: From `RangeSensor.camera`.
        scale: Of one unit of depth [m]: 0.001 of most cameras.
        sigma_1m: Standard deviation of z at 1 m; it grows with z² where depth comes from disparity,
            σ(z) = z² σ_d / (f b) with the focal length f and the error of disparity σ_d [pixels] and the base line b
            [m]. The sensor's own, the same at any z, where it is None [m].

    Raises:
        ConfigurationError: Names the attribute that is wrong.
    """

    sensor: RangeSensor
    scale: float = 0.001
    sigma_1m: float | None = None
    _stretch: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_sensor("DepthCamera", self.sensor)
        ahead = self.sensor.directions[:, 2]
        if not ahead.min() > 1e-3:
            raise ConfigurationError("DepthCamera", "sensor", self.sensor, "zones before the camera, z > 0")
        if not (is_number(self.scale) and self.scale > 0.0):
            raise ConfigurationError("DepthCamera", "scale", self.scale, "a length > 0 [m]")
        if self.sigma_1m is not None and not (is_number(self.sigma_1m) and self.sigma_1m >= 0.0):
            raise ConfigurationError("DepthCamera", "sigma_1m", self.sigma_1m, "a length >= 0 [m]")
        object.__setattr__(self, "_stretch", self.scale / ahead)

    def image(self, depth: ArrayLike, *, stamp: float) -> RangeImage:
        """An image of one frame; never raises: a frame of another size, or of no numbers, tells nothing.

        Args:
            depth: (rows, columns).
            stamp: When it was taken, by the clock of `step(now=...)` [s].
        """
        sensor = self.sensor
        found = numbers(depth, len(sensor))
        if found is None or found.shape[1] != 1 or (np.ndim(depth) == 2 and np.shape(depth) != sensor.shape):
            return says_nothing(sensor, stamp)
        raw = found[:, 0]
        if raw.dtype.kind == "f":
            valid = (raw > 0) | (raw == -np.inf)
            distances = np.where(raw == -np.inf, 0.0, raw) * self._stretch
        else:
            valid = (raw > 0) & (raw < np.iinfo(raw.dtype).max)
            distances = raw * self._stretch
        distances[~valid] = np.nan
        if self.sigma_1m is None:
            return RangeImage(sensor, distances, stamp, valid)
        # along the ray, too, z stands in the square: σ_ray = σ_1m z² / c = σ_1m c d² with c the direction's z
        sigma = distances * distances
        sigma *= self.sigma_1m * sensor.directions[:, 2]
        return RangeImage(sensor, distances, stamp, valid, sigma)
