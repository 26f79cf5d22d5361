"""What all adapters do: a sensor that is one; numbers of the right count, or an image that says nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import RangeImage, RangeSensor


def check_sensor(where: str, sensor: object) -> None:
    """Refuse what is no sensor of many zones.

    Raises:
        ConfigurationError: It is none.
    """
    if not isinstance(sensor, RangeSensor):
        raise ConfigurationError(where, "sensor", sensor, "a RangeSensor")


def numbers(values: object, count: int) -> NDArray[Any] | None:
    """Real numbers, the same count of them for each of some zones, (zones, n); None where that is not what they are.

    Masked ones are none.

    Args:
        values: As they came.
        count: Of zones.
    """
    try:
        array = np.asarray(values)
    except Exception:  # rows of different lengths, and whatever a stranger's __array__ raises
        return None
    if np.ma.is_masked(values) or array.dtype.kind not in "iuf" or array.size == 0 or array.size % count:
        return None
    return array.reshape(count, -1)


def says_nothing(sensor: RangeSensor, stamp: float) -> RangeImage:
    """An image without a valid zone: for data that is not of the sensor's form."""
    return RangeImage(sensor, np.full(len(sensor), np.nan), stamp, np.zeros(len(sensor), dtype=bool))
