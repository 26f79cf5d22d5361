"""Sensors of a controller, checked at construction."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from typing import TYPE_CHECKING, Any

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.detection import BadInput

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


def checked_sensors(sensors: Any, robot: Robot) -> tuple[RangeSensor, ...]:
    """Sensors that a robot's cell can hold.

    Raises:
        ConfigurationError: None, no sensors, two of one name, or one that does not fit the robot.
    """
    where, expected = "SafetyController", "RangeSensors, each with a name of its own"
    if isinstance(sensors, RangeSensor | str) or not isinstance(sensors, Iterable):
        raise ConfigurationError(where, "range_sensors", sensors, "a list of " + expected)
    found: dict[str, RangeSensor] = {}
    for sensor in sensors:
        if not isinstance(sensor, RangeSensor) or sensor.name in found:
            raise ConfigurationError(where, "range_sensors", sensor, expected)
        sensor.check(robot)
        found[sensor.name] = sensor
    if not found:
        raise ConfigurationError(where, "range_sensors", sensors, "at least one RangeSensor")
    return tuple(found.values())


def check_clock(now: float, before: float) -> float:
    """The present time [s], unless no image would ever be stale by it.

    A clock that was set back is refused until it has caught up, or until the controller is reset.

    Raises:
        BadInput: It is not finite, or not later than that of the last tick.
    """
    if not before < now < inf:
        raise BadInput(f"now = {now} s, expected a finite time later than that of the last tick, {before} s")
    return now
