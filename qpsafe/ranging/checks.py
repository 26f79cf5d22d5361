"""Sensors of a controller, checked at construction."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import RangeSensor

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
