"""Whether an image can be used at all, and what is wrong with it otherwise."""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.checks import as_time
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import RangeImage, RangeSensor
from qpsafe.sensing.detection import BadInput, as_floats

Array = NDArray[np.float64]


class Usable(NamedTuple):
    """An image whose arrays fit its sensor.

    Attributes:
        distances: (z,) [m], any numbers.
        valid: Which zones tell anything (z,).
        sigma: (z,) [m], finite, at least 0; without strides where it is one number.
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
        rules: Numbers for images.
        tolerance: How far before known things a point is still taken for them [m].
    """

    def __init__(self, sensor: RangeSensor, rules: RangeRules, tolerance: float) -> None:
        self._sensor, self._same = sensor, sensor
        # of what a larger sigma says nothing is told: all that matters could be the robot itself
        self._vague = max(rules.reach - tolerance, 0.0) / max(rules.deviations, 1e-9)
        self._all, self._sigma = np.ones(len(sensor), dtype=np.bool_), np.broadcast_to(sensor.sigma, (len(sensor),))

    def __call__(self, image: RangeImage) -> Usable:
        """Its arrays.

        Raises:
            BadInput: They do not fit, or are no numbers; or the image is of a sensor of other optics, or in
                another place, than were declared.
        """
        sensor, size = self._sensor, len(self._sensor)
        if image.sensor is not self._same:
            if not sensor.same_zones(image.sensor):
                raise BadInput(
                    f"its zones are others than declared: {image.sensor.shape}, not {sensor.shape}, or turned"
                )
            if not sensor.same_place(image.sensor):
                raise BadInput("its sensor is fixed elsewhere than declared: where it is, is given at construction")
            self._same = image.sensor
        distances = self._fitting("distances", as_floats("distances", image.distances))
        valid, sigma = self._all, self._sigma
        if image.valid is not None:
            valid = self._fitting("valid", _flags(image.valid))
        if image.sigma is not None:
            sigma = as_floats("sigma", image.sigma)
            sigma = np.broadcast_to(sigma.ravel(), (size,)) if sigma.size == 1 else self._fitting("sigma", sigma)
            none = ~((sigma >= 0.0) & (sigma < inf))  # true for NaN
            if none.any():  # of what reads nothing, or cannot tell, nobody asks for it
                if (none & valid & (distances <= sensor.range_max)).any():
                    raise BadInput("sigma is not finite, or below zero, where zones are valid")
                sigma = np.where(none, sensor.sigma, sigma)
        if (image.sigma is not None or sensor.sigma > self._vague) and sigma.max() > self._vague:
            valid = valid & ((sigma <= self._vague) | (distances < sensor.range_min))
        return Usable(distances, valid, sigma, as_time("stamp", image.stamp), sensor.shape)

    def _fitting(self, name: str, array: NDArray[Any]) -> NDArray[Any]:
        if array.shape not in ((len(self._sensor),), self._sensor.shape):
            raise BadInput(f"{name} have shape {array.shape}, expected {self._sensor.shape}, or as many in a row")
        return array.reshape(-1)


def _flags(value: object) -> NDArray[np.bool_]:
    """`value` as an array of true and false; or BadInput."""
    try:
        array = np.asarray(value)
    except Exception as error:  # whatever a stranger's __array__ raises
        raise BadInput(f"valid is not an array of bool ({type(error).__name__})") from None
    if array.dtype != np.bool_ or np.ma.is_masked(value):
        raise BadInput(f"valid is of {array.dtype}, expected bool, none of them masked")
    return array
