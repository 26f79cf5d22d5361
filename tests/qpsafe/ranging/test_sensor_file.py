"""The file of arrays: what is written is what is loaded, mistakes are named, and what is bundled sits on the skin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import qpsafe
from qpsafe.ranging.sensor_file import range_sensor_files, read_range_sensors
from qpsafe.robot.models.hulls import solid_geoms
from qpsafe.robot.models.mjcf import held_positions
from qpsafe.robot.models.mujoco_spec import mujoco_model

HEADER = {
    "sensor": '"Any"',
    "zones": "[2, 3]",
    "field_of_view": "30.0",
    "range_min": "0.02",
    "range_max": "4.0",
    "rate": "15",
    "sigma": "0.015",
}
ARRAY = {"name": '"a"', "link": "6", "frame": '"dh6"', "position": "[0.0, 0.2, 0.0]", "direction": "[0.0, 1.0, 0.0]"}


def written(folder: Path, header: dict[str, str | None] | None = None, array: dict[str, str] | None = None) -> Path:
    """A file of two arrays, the second one changed; None leaves a key out."""
    lines = [f"{key} = {value}" for key, value in (HEADER | (header or {})).items() if value is not None]
    for item in (ARRAY | {"name": '"first"'}, ARRAY | (array or {})):
        lines += ["[[spot]]", *(f"{key} = {value}" for key, value in item.items())]
    path = folder / "spots-any.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_what_is_written_is_what_is_loaded(irb140: Any, tmp_path: Path) -> None:
    turned = {"name": '"b"', "rotation": "[[0, 0, 1], [1, 0, 0], [0, 1, 0]]", "field_of_view": "60", "range_max": "2"}
    path = written(tmp_path, array=turned)
    path.write_text(path.read_text(encoding="utf-8").replace("direction = [0.0, 1.0, 0.0]\nrotation", "rotation"))
    first, second = sensors = qpsafe.load_range_sensors(irb140, path)
    for sensor in sensors:
        sensor.check(irb140)
        assert (sensor.mount, sensor.shape, sensor.range_min, sensor.sigma) == ("dh6", (2, 3), 0.02, 0.015)
        assert sensor.link is None  # a point acts on the link nearest to it
        assert sensor.period == pytest.approx(1.0 / 15.0)
        assert sensor.pose[:3, 3].tolist() == [0.0, 0.2, 0.0]
    assert (first.name, second.name) == ("first", "b")
    assert (first.range_max, second.range_max) == (4.0, 2.0)
    assert first.pose[:3, 2] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert second.pose[:3, :3].tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    for sensor, edge in ((first, 30.0), (second, 60.0)):  # three zones across: the outer ones look a third aside
        across = np.rad2deg(np.arctan2(sensor.directions[:, 0], sensor.directions[:, 2])).reshape(2, 3)
        assert across == pytest.approx(np.array([[-edge / 3, 0.0, edge / 3]] * 2))


MISTAKES: dict[str, tuple[str, str | None]] = {
    # key that must be named -> what stands there instead, TOML; for `spot` in the second one of two
    "zones": ("header", None),
    "zones ": ("header", "[8]"),
    "zones  ": ("header", "[0, 8]"),
    "zones   ": ("header", "[8.0, 8]"),
    "zones    ": ("header", "[65, 8]"),
    "zones     ": ("header", "64"),
    "field_of_view": ("header", None),
    "field_of_view ": ("header", "0.0"),
    "field_of_view  ": ("header", "91"),
    "rate": ("header", None),
    "rate ": ("header", "0"),
    "rate  ": ("header", "inf"),
    "sigma": ("header", None),
    "sigma ": ("header", "-0.1"),
    "sigma  ": ("header", "nan"),
    "range_min": ("header", "5.0"),
    "link": ("spot", "7"),
    "frame": ("spot", '"dh7"'),
    "position": ("spot", "[0.0, 0.0]"),
    "direction": ("spot", "[0.0, 2.0, 0.0]"),
    "field_of_view   ": ("spot", "0.0"),
    "name": ("spot", '"first"'),
    "colour": ("spot", '"orange"'),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(irb140: Any, tmp_path: Path, mistake: str) -> None:
    where, value = MISTAKES[mistake]
    key = mistake.strip()
    path = written(tmp_path, {key: value}) if where == "header" else written(tmp_path, array={key: value or ""})
    with pytest.raises(qpsafe.RobotFileError) as caught:
        read_range_sensors(path, irb140)
    error = caught.value
    assert error.where == str(path)
    assert key in error.key
    assert ("spot[1]" in error.key or "spot.1" in error.key) == (where == "spot")
    assert error.expected


def test_a_zone_wider_than_a_sensor_may_have_is_named(irb140: Any, tmp_path: Path) -> None:
    path = written(tmp_path, {"zones": "[1, 1]", "field_of_view": "70"})
    with pytest.raises(qpsafe.RobotFileError, match=r"field_of_view = 70.*1 x 1.*at most 60 deg"):
        read_range_sensors(path, irb140)


def test_a_sensor_that_the_robot_does_not_have_is_named_with_those_it_has(irb140: Any) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match=r"sensors = 'eyes'.*vl53l5cx"):
        qpsafe.load_range_sensors(irb140, "eyes")
    with pytest.raises(qpsafe.RobotFileError, match=r"spots-by-hand\.toml: zones"):
        qpsafe.load_range_sensors(irb140, "by-hand")  # spots, not arrays


@pytest.mark.parametrize("name", qpsafe.bundled_robots())
def test_bundled_arrays_sit_on_the_skin_and_see_something(name: str) -> None:
    """1 cm before each and in all its zones MuJoCo's rays are cast: it is not buried, and most zones look away."""
    robot = qpsafe.load_robot(name)
    model: Any = mujoco_model(robot)
    data = mujoco.MjData(model)
    addresses, values = held_positions(model, robot.held)
    data.qpos[addresses] = values
    for joint, value in zip(robot.joint_names, robot.home, strict=True):
        data.qpos[model.joint(joint).qposadr] = value
    mujoco.mj_kinematics(model, data)
    model.geom_group[:] = np.where(solid_geoms(model), 3, 2)
    seen = np.array([0, 0, 0, 1, 0, 0], dtype=np.uint8)
    files = range_sensor_files(robot)
    assert "vl53l5cx" in files
    state = robot.at(robot.home)
    for path in files.values():
        sensors = qpsafe.load_range_sensors(robot, path)
        assert len(sensors) == 20
        assert len({sensor.name for sensor in sensors}) == 20
        hit = np.zeros(1, dtype=np.int32)
        for sensor in sensors:
            sensor.check(robot)
            T = state.pose(sensor.mount) @ sensor.pose
            above = T[:3, 3] + 0.01 * T[:3, 2]
            height = mujoco.mj_ray(model, data, above, -T[:3, 2], seen, 1, -1, hit, None)
            assert 0.005 < height < 0.025, sensor.name  # the skin, as the shapes that collide have it, is under it
            free = [
                mujoco.mj_ray(model, data, above, T[:3, :3] @ d, seen, 1, -1, hit, None) < 0 for d in sensor.directions
            ]
            assert np.mean(free) >= 0.5, sensor.name
