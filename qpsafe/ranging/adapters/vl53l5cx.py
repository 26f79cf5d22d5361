"""Frames of ST's 8x8 time-of-flight sensors VL53L5CX and VL53L8CX, as their driver (ULD) gives them, as images.

From data sheets DS13754 and DS14161 and the driver's manuals UM2884 and UM3109:

- 4x4 or 8x8 zones over 45 x 45 degrees; 8x8 at up to 15 Hz, 4x4 at up to 60 Hz; 2 cm to 4 m.
- The values of target t in zone i stand at `targets * i + t`. 5 and 9 (a large pulse, perhaps two targets merged) are
  the statuses of a valid range; 255 says that there is no target. All others (0 not updated, 1 to 4 and 7, 8, 11 to 13
  signal, sigma, phase or consistency, 6 wrap-around not checked, 10 no target before) say that the range is not to be
  relied on: the zone is not valid then, and never free.
- The lens turns the image over: zone 0 looks at the top right of the scene, seen from the sensor; zones go on to the
  left, rows go down.
- The sensor converts from ray to axis: before a wall that it faces, all zones read the same. Distances along the rays
  are longer by 1 / cos of the zone's angle, 12 % in the corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.raw import check_sensor, numbers, says_nothing
from qpsafe.ranging.given import parts_of
from qpsafe.ranging.sensor import RangeImage, RangeSensor

Array = NDArray[np.float64]

FIELD_OF_VIEW = np.pi / 4  # from edge to edge
VALID = (5, 9)
NO_TARGET = 255
ORDERS = ("driver", "scene")
MEASURES = ("axis", "ray")


def vl53l5cx(name: str, zones: int = 8, **parts: object) -> RangeSensor:
    """A VL53L5CX or VL53L8CX at its fastest: 8x8 zones at 15 Hz, or 4x4 at 60 Hz.

    Args:
        name: Of its own.
        zones: Along a side, 8 or 4.
        parts: Other attributes of the `RangeSensor`, such as `mount` and `pose`.

    Raises:
        ConfigurationError: Another number of zones, or a part that is wrong.
    """
    if not isinstance(zones, int) or zones not in (4, 8):
        raise ConfigurationError(f"vl53l5cx {name!r}", "zones", zones, "4 or 8")
    figures: dict[str, object] = {"range_min": 0.02, "range_max": 4.0, "sigma": 0.02}
    figures["period"] = 1.0 / 15.0 if zones == 8 else 1.0 / 60.0
    return RangeSensor.array(name, zones, zones, FIELD_OF_VIEW, **(figures | parts))


@dataclass(frozen=True, eq=False)
class Vl53l5cx:
    """Makes images of such a sensor's frames.

    Attributes:
        sensor: From `vl53l5cx`, or any other of 4x4 or 8x8 zones.
        order: Of the zones in a frame: as the "driver" has them, or of the "scene", rows from the top and from left to
            right, where somebody has put them so.
        along: What distances are along: the sensor's "axis", or each zone's "ray".
        valid: Statuses of a range that can be relied on.

    Raises:
        ConfigurationError: Names the attribute that is wrong.
    """

    sensor: RangeSensor
    order: str = "driver"
    along: str = "axis"
    valid: Sequence[int] = VALID
    _zones: NDArray[np.int64] = field(init=False, repr=False)
    _scale: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_sensor("Vl53l5cx", self.sensor)
        rows, columns = self.sensor.shape
        for key, value, known in (("order", self.order, ORDERS), ("along", self.along, MEASURES)):
            if not isinstance(value, str) or value not in known:
                raise ConfigurationError("Vl53l5cx", key, value, f"one of {', '.join(known)}")
        if (rows, columns) not in ((4, 4), (8, 8)):
            raise ConfigurationError("Vl53l5cx", "sensor", self.sensor, "4x4 or 8x8 zones")
        valid = parts_of(self.valid)
        if not (valid and all(isinstance(status, int) for status in valid)) or NO_TARGET in valid:
            raise ConfigurationError("Vl53l5cx", "valid", self.valid, "statuses of a range, whole numbers, not 255")
        zones = np.arange(rows * columns).reshape(rows, columns)
        object.__setattr__(self, "valid", valid)
        object.__setattr__(self, "_zones", (zones[:, ::-1] if self.order == "driver" else zones).ravel())
        lean = self.sensor.directions[:, 2] if self.along == "axis" else np.ones(rows * columns)
        object.__setattr__(self, "_scale", 1e-3 / lean)

    def image(
        self,
        distance_mm: ArrayLike,
        target_status: ArrayLike,
        *,
        stamp: float,
        range_sigma_mm: ArrayLike | None = None,
        nb_target_detected: ArrayLike | None = None,
    ) -> RangeImage:
        """An image of one frame; never raises. The nearest valid target of a zone counts.

        "Nothing in sight" is said of a zone whose targets all have status 255, and, where their number is given, whose
        number is 0. What is neither that nor valid tells nothing, and so does a frame of another size or of no numbers.

        Args:
            distance_mm: (zones * targets,) or any shape in that order [mm].
            target_status: Likewise.
            stamp: When it was taken, by the clock of `step(now=...)` [s]: about half a period before it can be read.
            range_sigma_mm: Standard deviations, likewise [mm]; the sensor's own by default.
            nb_target_detected: Number of targets in each zone, (zones,); not looked at by default.
        """
        sensor, count = self.sensor, len(self.sensor)
        distance, status = numbers(distance_mm, count), numbers(target_status, count)
        if distance is None or status is None or distance.shape != status.shape:
            return says_nothing(sensor, stamp)
        trusted = np.isfinite(distance)
        trusted &= np.logical_or.reduce([status == known for known in self.valid])
        nothing = (status == NO_TARGET).all(axis=1)
        if nb_target_detected is not None:
            targets = numbers(nb_target_detected, count)
            if targets is None or targets.shape[1] != 1:
                return says_nothing(sensor, stamp)
            trusted &= np.arange(distance.shape[1]) < targets  # what stands behind them is left from earlier
            nothing &= targets[:, 0] == 0
        # the driver cuts distances off at 0: what is there is at the sensor
        near = np.where(trusted, np.maximum(distance, 0), np.inf)
        which = near.argmin(axis=1)[:, None]
        near = np.take_along_axis(near, which, axis=1)[:, 0]
        seen = near < np.inf
        near[~seen & ~nothing] = np.nan
        zones = self._zones
        sigma = None if range_sigma_mm is None else numbers(range_sigma_mm, count)
        if range_sigma_mm is not None and (sigma is None or sigma.shape != distance.shape):
            return says_nothing(sensor, stamp)
        if sigma is not None:
            found = np.take_along_axis(sigma, which, axis=1)[:, 0]
            # cut off to whole millimetres; what is no number tells as little as no number
            found = np.where(seen & (found >= 0) & (found < np.inf), np.maximum(found, 1), sensor.sigma / self._scale)
            return RangeImage(
                sensor, near[zones] * self._scale, stamp, (seen | nothing)[zones], found[zones] * self._scale
            )
        return RangeImage(sensor, near[zones] * self._scale, stamp, (seen | nothing)[zones])
