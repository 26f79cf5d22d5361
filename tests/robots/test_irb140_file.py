"""robot.toml of the IRB 140, and what is said about every mistake a person can make in such a file."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from qpsafe.errors import ConfigurationError, RobotFileError, RobotWarning
from qpsafe.robot.loader import load_robot

GOOD = load_robot("irb140")
TEXT = (GOOD.folder / "robot.toml").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(GOOD.model_path, tmp_path / "robot.xml")
    return tmp_path


def write(folder: Path, *changes: tuple[str, str]) -> Path:
    """The good file with the first occurrence of each old text replaced."""
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return folder


JOINT_2 = "[joints.joint_2]\nlower = -90.0\nupper = 110.0\nmax_velocity = 200.0\nmax_acceleration = 600.0\n"
DH_ROW = "    { theta = 0.0,   d = 0.0,   a = 0.0,   alpha = -90.0 },\n"

# what is changed -> key and value that the error names, and a word of what it says is expected
MISTAKES = {
    "unit of angle": ('angle = "deg"', 'angle = "degrees"', "units.angle", "degrees", "'deg'"),
    "unit of length": ('length = "m"', 'length = "inch"', "units.length", "inch", "'mm'"),
    "unit of mass": ('mass = "kg"', 'mass = "lb"', "units.mass", "lb", "'kg'"),
    "unit not stated": ('angle = "deg"\n', "", "units.angle", None, "missing"),
    "joint missing": (JOINT_2, "", "home", None, "5 values"),
    "joint of another name": ("[joints.joint_2]", "[joints.axis_2]", "joints.joint_2", None, "missing"),
    "lower above upper": ("lower = -90.0", "lower = 120.0", "joints.joint_2.lower", 120.0, "less than upper"),
    "lower equal to upper": ("lower = -90.0", "lower = 110.0", "joints.joint_2.lower", 110.0, "less than upper"),
    "not a number": ("upper = 110.0", "upper = nan", "joints.joint_2.upper", "nan", "finite"),
    "infinite": ("upper = 110.0", "upper = inf", "joints.joint_2.upper", float("inf"), "finite"),
    "a string": ("upper = 110.0", 'upper = "110"', "joints.joint_2.upper", "110", "number"),
    "a truth value": ("upper = 110.0", "upper = true", "joints.joint_2.upper", True, "number"),
    "limit missing": ("upper = 110.0\n", "", "joints.joint_2.upper", None, "missing"),
    "beyond the model's range": ("upper = 110.0", "upper = 111.0", "joints.joint_2.upper", 111.0, "range in robot.xml"),
    "radians taken for degrees": (
        'angle = "deg"',
        'angle = "rad"',
        "joints.joint_1.lower",
        -180.0,
        "range in robot.xml",
    ),
    "negative speed": (
        "max_velocity = 260.0",
        "max_velocity = -260.0",
        "joints.joint_3.max_velocity",
        -260.0,
        "greater",
    ),
    "no speed": ("max_velocity = 260.0", "max_velocity = 0", "joints.joint_3.max_velocity", 0, "greater"),
    "no acceleration": ("= 1500.0", "= 0.0", "joints.joint_6.max_acceleration", 0.0, "greater"),
    "unknown key": ("upper = 110.0", "upper = 110.0\nmaxspeed = 1.0", "joints.joint_2.maxspeed", 1.0, "no such key"),
    "unknown table": ("[tool]", "[gripper]\na = 1\n[tool]", "gripper", {"a": 1}, "no such key"),
    "unknown site": ('tcp = "tcp"', 'tcp = "tip"', "frames.tcp", "tip", "site or body"),
    "unknown frame in the wire": ('["dh5", "tcp"]', '["dh5", "tip"]', "wire.links[5]", "tip", "dh0, dh1"),
    "unknown frame of the tool": ('frame = "tcp"', 'frame = "tip"', "tool.frame", "tip", "dh0, dh1"),
    "unknown mount": ('mounted_on = "flange"', 'mounted_on = "hand"', "tool.mounted_on", "hand", "flange"),
    "half a wire link": ('["dh5", "tcp"]', '["dh5"]', "wire.links[5]", ["dh5"], "2 items"),
    "no wire": ("[wire]\n", "[wire]\nlinks = []\n[wire_]\n", "wire.links", [], "1 item"),
    "too few rows": (DH_ROW, "", "denavit_hartenberg.rows", "5 rows", "6 rows"),
    "too many rows": (DH_ROW, 2 * DH_ROW, "denavit_hartenberg.rows", "7 rows", "6 rows"),
    "too few frames": ('["dh0", "dh1", ', '["dh0", ', "denavit_hartenberg.frames", None, "7 frames"),
    "a row that is not the model's": ("d = 0.380", "d = 0.381", "denavit_hartenberg.rows[3]", None, "dh4"),
    "a sign that is not the model's": ("alpha = 90.0", "alpha = -90.0", "denavit_hartenberg.rows[3]", None, "dh4"),
    "a tool elsewhere": ("0.0, 0.14]", "0.0, 0.15]", "tool.offset", [0.0, 0.0, 0.15], "0.14]"),
    "a tool in two dimensions": ("[0.0, 0.0, 0.14]", "[0.0, 0.14]", "tool.offset", [0.0, 0.14], "3 items"),
    "a tool of negative mass": ("mass = 0.6", "mass = -0.6", "tool.mass", -0.6, "greater"),
    "home outside the limits": ("0.0, 85.0, 0.0]", "0.0, 116.0, 0.0]", "home[4]", 116.0, "joint_5"),
    "home too short": ("0.0, 85.0, 0.0]", "0.0, 85.0]", "home", [0.0, -5.0, 0.0, 0.0, 85.0], "6 values"),
    "model file missing": ('model = "robot.xml"', 'model = "arm.xml"', "model", "arm.xml", "file"),
    "not TOML": ("upper = 110.0", "upper = = 110.0", "line ", "upper = = 110.0", "TOML"),
    "the same key twice": ("upper = 110.0", "lower = 110.0", "line ", "lower = 110.0", "TOML"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_an_error_that_names_file_key_and_value(mistake: str, folder: Path) -> None:
    old, new, key, value, expected = MISTAKES[mistake]
    with pytest.raises(RobotFileError) as caught:
        load_robot(write(folder, (old, new)))
    error = caught.value
    assert error.where == str(folder / "robot.toml")
    assert error.key.startswith(key)
    assert expected in error.expected
    if value is not None:
        assert str(error.value) == str(value)
    for part in (error.where, error.key, repr(error.value), error.expected):
        assert part in str(error)
    assert isinstance(error, ConfigurationError)
    assert isinstance(error, ValueError)


def test_the_unchanged_copy_loads(folder: Path) -> None:
    robot = load_robot(write(folder))
    assert robot.folder == folder
    np.testing.assert_array_equal(robot.upper, GOOD.upper)


def test_a_folder_without_robot_toml(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"robot\.toml"):
        load_robot(tmp_path)


def test_a_missing_joint_is_named_when_home_is_shortened_with_it(folder: Path) -> None:
    changes = [(JOINT_2, ""), ("home = [0.0, -5.0, ", "home = [0.0, "), (DH_ROW, ""), ('"dh0", "dh1", ', '"dh0", ')]
    with pytest.raises(RobotFileError) as caught:
        load_robot(write(folder, *changes))
    assert caught.value.key == "joints.joint_2"
    assert "missing" in caught.value.expected


def test_a_broken_model_file_is_named(folder: Path) -> None:
    (folder / "robot.xml").write_text("<mujoco><worldbody>", encoding="utf-8")
    with pytest.raises(RobotFileError, match=r"robot\.xml"):
        load_robot(write(folder))


def test_units_do_not_change_the_robot(folder: Path) -> None:
    """The same robot stated in radians and millimetres is the same robot."""
    import re

    def scale(keys: str, factor: float, text: str) -> str:
        pattern = rf"\b({keys}) = (-?[\d.]+)"
        return re.sub(pattern, lambda hit: f"{hit[1]} = {float(hit[2]) * factor!r}", text)

    text = scale("lower|upper|max_velocity|max_acceleration|theta|alpha", np.pi / 180, TEXT)
    text = scale("d|a", 1000.0, text)
    text = text.replace("[0.0, 0.0, 0.14]", "[0.0, 0.0, 140.0]")
    text = text.replace("[0.0, -5.0, 0.0, 0.0, 85.0, 0.0]", str(GOOD.home.tolist()))
    text = text.replace('angle = "deg"', 'angle = "rad"').replace('length = "m"', 'length = "mm"')
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    robot = load_robot(folder)
    for name in ("lower", "upper", "max_velocity", "max_acceleration", "home", "dh"):
        np.testing.assert_allclose(getattr(robot, name), getattr(GOOD, name), rtol=1e-14)
    np.testing.assert_allclose(robot.tool.offset, GOOD.tool.offset, rtol=1e-14)


def test_joint_order_in_the_file_does_not_matter(folder: Path) -> None:
    text = TEXT.replace(JOINT_2, "") + "\n" + JOINT_2
    text = text.replace("[0.0, -5.0, 0.0, 0.0, 85.0, 0.0]", "[0.0, 0.0, 0.0, 85.0, 0.0, -5.0]")
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    robot = load_robot(folder)
    np.testing.assert_array_equal(robot.upper, GOOD.upper)
    np.testing.assert_array_equal(robot.home, GOOD.home)


def test_spots_are_optional(folder: Path) -> None:
    with pytest.warns(RobotWarning, match=r"spots\.toml.*not there: no sensors"):
        assert load_robot(write(folder)).spots_path is None
    (folder / "spots.toml").touch()
    assert load_robot(write(folder)).spots_path == folder / "spots.toml"
