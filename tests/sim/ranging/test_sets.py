"""What a sensor's name stands for, and what the camera of the experiments sees."""

from __future__ import annotations

import numpy as np
import pytest

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import WORLD
from qpsafe.sim.ranging.sets import (
    RANGING,
    SensorKinds,
    lines_of_sight,
    overhead_camera,
    range_sensors,
    sensor_kinds,
)
from qpsafe.sim.world.sensor import SENSORS

ROBOT = qpsafe.load_robot("irb140")


@pytest.mark.parametrize(
    ("name", "spots", "ranging"),
    [
        ("ideal", "ideal", ()),
        ("perfect", "perfect", ()),
        ("vl53l5cx", None, ("vl53l5cx",)),
        ("sharp+depth", "sharp", ("depth",)),
        ("depth+vl53l5cx-ideal", None, ("depth", "vl53l5cx-ideal")),
    ],
)
def test_names_have_parts(name, spots, ranging) -> None:
    assert sensor_kinds(name) == SensorKinds(spots, ranging)
    assert len(lines_of_sight(name, ROBOT)) == (0 if name == "depth" else 20)


@pytest.mark.parametrize(
    "name", ["", "+", "foo", "ideal+sharp", "depth+depth", "depth+depth-ideal", "perfect+depth", "depth+", None, 3]
)
def test_other_names_are_refused_and_told_what_there_is(name) -> None:
    with pytest.raises(ConfigurationError, match="sharp\\+depth") as caught:
        sensor_kinds(name)
    assert all(kind in caught.value.expected for kind in (*SENSORS, *RANGING))


def test_every_kind_is_made_and_belongs_to_the_robot() -> None:
    sensors, models = range_sensors(("vl53l5cx", "depth"), ROBOT)
    assert len(sensors) == len(models) == 21
    for sensor in sensors:
        sensor.check(ROBOT)
    quiet, plain = range_sensors(("vl53l5cx-ideal", "depth-ideal"), ROBOT)
    assert [s.name for s in quiet] == [s.name for s in sensors]
    assert {model.latency for model in plain} == {0.0}


def test_the_camera_looks_at_the_robot_level_and_from_above() -> None:
    """The robot's tool and people before it and at its sides are in the picture."""
    camera = overhead_camera()
    assert camera.mount == WORLD
    assert len(camera) == 60 * 80
    into = np.linalg.inv(camera.pose)
    half = np.array([319.5, 239.5]) / 385.0
    for place in (ROBOT.pose("tcp", ROBOT.home)[:3, 3], (1.0, 0.0, 0.3), (0.3, 1.0, 0.0), (0.3, -1.0, 0.0)):
        x, y, z = into[:3, :3] @ place + into[:3, 3]
        assert z > 0.2
        assert abs(x / z) < half[0]
        assert abs(y / z) < half[1]
    assert camera.pose[2, 0] == pytest.approx(0.0)  # its x axis is level
    assert camera.pose[2, 1] < 0.0  # and its y axis points down
