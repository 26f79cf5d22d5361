"""One image of a sensor that ranges."""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

from qpsafe.ranging.sensor import RangeSensor


class RangeImage(NamedTuple):
    """What a sensor of many zones saw at one moment: the one input of everything that ranges.

    It is data: nothing is checked when it is made. `SafetyController.step(images=...)` judges it, and reports what it
    cannot use.

    Attributes:
        sensor: Which one: its zones, where it is fixed, how far it looks.
        distances: Of what is nearest in each zone, along the zone's direction, (z,) or `sensor.shape` [m]. Beyond the
            sensor's range, +inf included, nothing is in sight (REP 117); NaN where the sensor cannot tell.
        stamp: When it was taken, by the clock of `step(now=...)` [s].
        valid: Which zones tell anything, likewise; None: those that are not NaN.
        sigma: Standard deviation of each distance, likewise or one number [m]; None: the sensor's.
    """

    sensor: RangeSensor
    distances: ArrayLike
    stamp: float
    valid: ArrayLike | None = None
    sigma: ArrayLike | None = None
