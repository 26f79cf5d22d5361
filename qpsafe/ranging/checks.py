"""Sensors of a controller, checked at construction."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import WORLD, RangeSensor
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


def as_time(name: str, value: Any) -> float:
    """A time that came with data [s].

    Raises:
        BadInput: It is no number, or not finite.
    """
    if type(value) is float and isfinite(value):
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool) or not isinstance(value, float | int | np.floating | np.integer):
        raise BadInput(f"{name} is no time: {type(value).__name__}")
    try:
        time = float(value)
    except OverflowError:  # a whole number of hundreds of digits
        time = inf
    if not isfinite(time):
        raise BadInput(f"{name} is not finite: {name} = {time} s")
    return time


def check_clock(now: Any, before: float) -> float:
    """The present time [s], unless no image would ever be stale by it.

    A clock that was set back is refused until it has caught up, or until the controller is reset.

    Raises:
        BadInput: It is no number, not finite, or not later than that of the last tick.
    """
    time = as_time("now", now)
    if not before < time:
        raise BadInput(f"now = {time} s, expected a time later than that of the last tick, {before} s")
    return time


def mounting(robot: Robot, sensor: RangeSensor) -> tuple[int, NDArray[np.float64]]:
    """The robot's body that carries a sensor, 0 for the world, and its pose there (4, 4)."""
    if sensor.mount == WORLD:
        return 0, sensor.pose
    body, place = robot.mounting(sensor.mount)
    return body, place @ sensor.pose
