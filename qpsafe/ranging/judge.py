"""Whether an image can be used at all, and what is wrong with it otherwise."""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.sensor import RangeImage, RangeSensor
from qpsafe.sensing.detection import BadInput, as_floats

Array = NDArray[np.float64]


class Usable(NamedTuple):
    """An image whose arrays fit its sensor.

    Attributes:
        distances: (z,) [m], any numbers.
        valid: Which zones tell anything (z,).
        sigma: (z,) [m], finite, at least 0.
        stamp: [s].
        shape: Rows and columns.
    """

    distances: Array
    valid: NDArray[np.bool_]
    sigma: Array
    stamp: float
    shape: tuple[int, int]


class Judge:
    """Takes images of one sensor apart.

    Args:
        sensor: As it was declared.
    """

    def __init__(self, sensor: RangeSensor) -> None:
        self._sensor, self._same = sensor, sensor
        self._all, self._sigma = np.ones(len(sensor), dtype=np.bool_), np.full(len(sensor), sensor.sigma)

    def __call__(self, image: RangeImage) -> Usable:
        """Its arrays.

        Raises:
            BadInput: They do not fit, or are no numbers; or the image was made with other optics than were declared.
        """
        sensor, size = self._sensor, len(self._sensor)
        if image.sensor is not self._same:
            if not sensor.same_zones(image.sensor):
                raise BadInput(
                    f"its zones are others than declared: {image.sensor.shape}, not {sensor.shape}, or turned"
                )
            self._same = image.sensor
        distances = self._array("distances", image.distances)
        valid, sigma = self._all, self._sigma
        if image.valid is not None:
            valid = np.asarray(image.valid)
            if valid.dtype != np.bool_ or valid.size != size:
                raise BadInput(f"valid is of {valid.dtype} and shape {valid.shape}, expected bool and {size} zones")
            valid = valid.reshape(size)
        if image.sigma is not None:
            sigma = (
                np.broadcast_to(as_floats("sigma", image.sigma).ravel(), (size,))
                if np.size(image.sigma) == 1
                else self._array("sigma", image.sigma)
            )
            if not (np.isfinite(sigma) | ~valid).all() or (sigma < 0.0).any():
                raise BadInput("sigma is not finite, or below zero, where zones are valid")
        stamp = image.stamp
        if isinstance(stamp, bool) or not isinstance(stamp, float | int | np.floating | np.integer):
            raise BadInput(f"stamp is no time: {type(stamp).__name__}")
        if not isfinite(stamp):
            raise BadInput(f"stamp is not finite: {stamp}")
        return Usable(distances, valid, sigma, float(stamp), sensor.shape)

    def _array(self, name: str, value: object) -> Array:
        array = as_floats(name, value)  # type: ignore[arg-type]
        if array.size != len(self._sensor):
            raise BadInput(f"{name} have shape {array.shape}, expected {self._sensor.shape}")
        return array.reshape(-1)
