"""Scans of a planar scanner, in the fields of a ROS LaserScan, as images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.raw import check_sensor, numbers, says_nothing
from qpsafe.ranging.given import is_number, parts_of
from qpsafe.ranging.sensor import RangeImage, RangeSensor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LaserScanner:
    """Makes images of scans.

    As REP 117 says, +inf is nothing in sight, -inf is too near to be measured, and counts as nearest, and NaN tells
    nothing. The message's definition has numbers outside `range_min` to `range_max` discarded: beyond, and at or below
    0, they tell nothing here, and are not free; between 0 and `range_min` something is near, and counts.

    Attributes:
        sensor: From `RangeSensor.planar`; its own range may be shorter than the scanner's.
        range_min: The scanner's smallest distance [m]; the sensor's by default.
        range_max: Its largest one [m]; likewise.

    Raises:
        ConfigurationError: Names the attribute that is wrong.
    """

    sensor: RangeSensor
    range_min: float | None = None
    range_max: float | None = None

    def __post_init__(self) -> None:
        check_sensor("LaserScanner", self.sensor)
        for key in ("range_min", "range_max"):
            if getattr(self, key) is None:
                object.__setattr__(self, key, getattr(self.sensor, key))
            if not is_number(getattr(self, key)):
                raise ConfigurationError("LaserScanner", key, getattr(self, key), "a finite distance [m]")
        least, most = self._range
        if not 0.0 <= least < most:
            raise ConfigurationError("LaserScanner", "range_max", most, f"a distance > range_min = {least} [m]")

    @property
    def _range(self) -> tuple[float, float]:
        assert self.range_min is not None
        assert self.range_max is not None
        return self.range_min, self.range_max

    @classmethod
    def of(cls, name: str, scan: Any, **parts: object) -> LaserScanner:
        """A scanner as one of its scans says it is.

        Args:
            name: Of its own.
            scan: With the fields `angle_min`, `angle_increment`, `range_min`, `range_max`, `ranges` and, if it is not
                0, `scan_time`: a ROS message, or anything with these attributes.
            parts: Other attributes of the `RangeSensor`; its range is the scanner's, but not above 25 m, by default.

        Raises:
            ConfigurationError: Names the field that is missing, or the part that is wrong.
        """
        where, fields = f"LaserScanner {name!r}", {"scan_time": getattr(scan, "scan_time", 0.0)}
        for key in ("angle_min", "angle_increment", "range_min", "range_max", "ranges"):
            if not hasattr(scan, key):
                raise ConfigurationError(where, key, scan, "a field of the scan")
            fields[key] = getattr(scan, key)
        for key, value in fields.items():
            if key != "ranges" and not is_number(value):
                raise ConfigurationError(where, key, value, "a finite number")
        least, most = float(fields["range_min"]), float(fields["range_max"])
        figures: dict[str, object] = {"range_min": least, "range_max": min(most, 25.0)}
        if fields["scan_time"] > 0.0:
            figures["period"] = float(fields["scan_time"])
        sensor = RangeSensor.planar(
            name, float(fields["angle_min"]), float(fields["angle_increment"]), len(parts_of(fields["ranges"])),
            **(figures | parts),
        )  # fmt: skip
        return cls(sensor, least, most)

    def image(self, scan: Any, *, stamp: float | None = None) -> RangeImage:
        """An image of one scan; never raises: what is not of the scanner's form tells nothing.

        The rays are all taken to be as old as the first one, which the stamp is of.

        Args:
            scan: Ranges (rays,) [m], or a message with them; its angles must be the sensor's then.
            stamp: When it was taken, by the clock of `step(now=...)` [s]; the message's by default.
        """
        sensor = self.sensor
        time = _stamp(scan) if stamp is None else stamp
        found = numbers(getattr(scan, "ranges", scan), len(sensor))
        if found is None or found.shape[1] != 1 or not self._same_angles(scan):
            return says_nothing(sensor, time)
        raw, (_, most) = found[:, 0].astype(np.float64), self._range
        near, nothing = raw == -np.inf, raw == np.inf
        valid = near | nothing | ((raw > 0.0) & (raw <= most))
        raw[near], raw[~valid] = 0.0, np.nan
        return RangeImage(sensor, raw, time, valid)

    def _same_angles(self, scan: Any) -> bool:
        """Whether a message's rays are the sensor's, as far as it says."""
        if not (hasattr(scan, "angle_min") and hasattr(scan, "angle_increment")):
            return True
        try:
            rays = np.arange(len(self.sensor))  # all: a full circle the other way round begins and halves alike
            angles = float(scan.angle_min) + float(scan.angle_increment) * rays
        except (TypeError, ValueError, OverflowError):
            return False
        ahead = self.sensor.directions[rays, :2]
        return bool((np.abs(np.stack((np.cos(angles), np.sin(angles)), axis=1) - ahead) <= 1e-3).all())


def _stamp(scan: Any) -> float:
    """Of a message's header, as ROS 2 or ROS 1 has it [s]; NaN where there is none."""
    stamp: Any = getattr(getattr(scan, "header", None), "stamp", None)
    try:
        if hasattr(stamp, "nanosec"):
            return float(stamp.sec) + 1e-9 * float(stamp.nanosec)
        return float(stamp.to_sec()) if hasattr(stamp, "to_sec") else float("nan")
    except Exception:  # whatever a stranger's stamp raises
        return float("nan")
