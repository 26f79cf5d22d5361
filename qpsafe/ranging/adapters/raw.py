"""What all adapters do with raw data: numbers of the right count, or an image that says nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.sensor import RangeImage

if TYPE_CHECKING:
    from qpsafe.ranging.sensor import RangeSensor


def numbers(values: object, count: int) -> NDArray[Any] | None:
    """Real numbers, the same count of them for each of some zones, (zones, n); None where that is not what they are.

    Args:
        values: As they came.
        count: Of zones.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):  # rows of different lengths
        return None
    if array.dtype.kind not in "iuf" or array.size == 0 or array.size % count:
        return None
    return array.reshape(count, -1)


def says_nothing(sensor: RangeSensor, stamp: float) -> RangeImage:
    """An image without a valid zone: for data that is not of the sensor's form."""
    return RangeImage(sensor, np.full(len(sensor), np.nan), stamp, np.zeros(len(sensor), dtype=bool))
