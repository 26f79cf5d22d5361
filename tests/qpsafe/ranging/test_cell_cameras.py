"""A cell's file gives the cameras that it describes, or says what is wrong in it and where."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.ranging.cell_cameras import looking, quaternion_of

GOOD = """
[[box]]
name = "table"
size = [0.8, 1.2, 0.05]
centre = [0.9, 0.0, 0.1]

[[camera]]
name = "ceiling"
kind = "depth"
resolution = [64, 48]
field_of_view = [90.0, 60.0]
position = [1.5, 0.0, 2.6]
look_at = [0.4, 0.0, 0.3]
range_max = 4.0
rate = 30.0

[[camera]]
name = "gate"
kind = "scanner"
angle_min = -90.0
increment = 0.5
rays = 361
position = [2.0, 0.0, 0.3]
quaternion = [0.0, 0.0, 0.0, 1.0]
range_max = 8.0
rate = 40.0
sigma = 0.02

[[camera]]
name = "post"
kind = "array"
zones = [4, 8]
field_of_view = 45.0
position = [0.0, 2.0, 1.0]
look_at = [0.0, 0.0, 1.0]
range_max = 3.5
rate = 15.0
max_age = 0.3
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "cell.toml"
    path.write_text(text)
    return path


def test_all_kinds(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    ceiling, gate, post = qpsafe.load_cameras(path)
    assert [sensor.mount for sensor in (ceiling, gate, post)] == ["world"] * 3
    assert (ceiling.shape, gate.shape, post.shape) == ((48, 64), (1, 361), (4, 8))
    assert (ceiling.period, gate.sigma, post.max_age) == (1.0 / 30.0, 0.02, 0.3)
    # the field of view is from edge to edge: half a pixel more than between the outer pixels' middles
    across = ceiling.directions.reshape(48, 64, 3)[23]
    assert across[0, 0] / across[0, 2] == pytest.approx(-31.5 / 32.0)
    # a scanner whose quaternion is half a turn about z looks back at the robot
    assert gate.pose[:3, :3] @ gate.directions[180] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-9)
    # obstacles are what they were
    assert [thing.name for thing in qpsafe.load_cell(path)] == ["table"]
    assert qpsafe.load_cameras(write(tmp_path, "")) == ()


@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6).map(np.array), st.booleans())
def test_what_is_looked_at_is_ahead_and_up_is_up(numbers: np.ndarray, planar: bool) -> None:
    position, at = numbers[:3], numbers[3:]
    if np.linalg.norm((at - position)[:2]) < 1e-3:
        return
    pose = looking(position, at, planar=planar)
    R = pose[:3, :3]
    assert pytest.approx(np.eye(3), abs=1e-9) == R @ R.T
    assert np.linalg.det(R) > 0.0
    inside = R.T @ (at - position)
    ahead = np.linalg.norm(at - position)
    assert inside == pytest.approx([ahead, 0, 0] if planar else [0, 0, ahead], abs=1e-9)
    assert (R[:, 2] if planar else -R[:, 1])[2] > 0.0


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).map(np.array))
def test_a_pose_survives_the_file(tmp_path_factory: pytest.TempPathFactory, numbers: np.ndarray) -> None:
    if np.linalg.norm(numbers) < 1e-2:
        return
    quaternion = numbers / np.linalg.norm(numbers)
    text = GOOD.replace("[0.0, 0.0, 0.0, 1.0]", str(quaternion.tolist()))
    sensor = qpsafe.load_cameras(write(tmp_path_factory.mktemp("cell"), text))[1]
    back = quaternion_of(sensor.pose[:3, :3])
    assert abs(back @ quaternion) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("[0.4, 0.0, 0.3]", "[1.5, 0.0, 0.3]", r"cell\.toml:13: camera\[0\]\.look_at"),
        ("look_at = [0.4, 0.0, 0.3]\n", "", r"cell\.toml:7: camera\[0\]\.look_at = 'nothing'"),
        ("position = [1.5, 0.0, 2.6]\nlook_at = [0.4, 0.0, 0.3]\n", "", r"camera\[0\]\.position.*calibrate-camera"),
        ("position = [1.5, 0.0, 2.6]\n", "", r"camera\[0\]\.position = 'nothing'"),
        ("range_max = 4.0\n", "", r"cell\.toml:7: camera\[0\]\.range_max = 'nothing'"),
        ("range_max = 4.0", "range_max = 0.01", r"cell\.toml:14: camera\[0\]\.range_max"),
        ("rate = 30.0", "rate = nan", r"cell\.toml:15: camera\[0\]\.rate = nan"),
        ('kind = "depth"', 'kind = "thermal"', r"cell\.toml:\d+: camera\[0\]"),
        ("field_of_view = [90.0, 60.0]\n", "", r"camera\[0\]\.intrinsics = 'nothing'"),
        ("field_of_view = [90.0, 60.0]", "intrinsics = [50.0, -1.0, 31.5, 23.5]", r"11: camera\[0\]\.intrinsics\[1\]"),
        ("[64, 48]", "[4096, 4096]", r"cell\.toml:10: camera\[0\]\.resolution"),
        ("increment = 0.5", "increment = 0.5\nzones = [8, 8]", r"cell\.toml:\d+: camera\[1\]\.zones"),
        ("[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0, 0.5]", r"cell\.toml:24: camera\[1\]\.quaternion"),
        ("zones = [4, 8]", "zones = [1, 1]", None),
        ("zones = [4, 8]\nfield_of_view = 45.0", "zones = [1, 1]\nfield_of_view = 90.0", r"camera\[2\]\.field_of_view"),
        ('"gate"', '"ceiling"', r"cell\.toml:18: camera\[1\]\.name"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, word: str | None) -> None:
    assert old in GOOD
    path = write(tmp_path, GOOD.replace(old, new))
    if word is None:
        qpsafe.load_cameras(path)
        return
    with pytest.raises(ConfigurationError, match=word):
        qpsafe.load_cameras(path)
