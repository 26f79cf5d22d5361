"""Recordings are read from a file or a folder, in metres or in units, and what is wrong is named."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.ranging.cell_cameras import load_cameras, looking
from qpsafe.ranging.extrinsics.cell_text import with_pose
from qpsafe.ranging.extrinsics.recording import load_recording
from qpsafe.ranging.sensor import RangeSensor

SENSOR = RangeSensor.camera("c", (6, 8), (5.0, 5.0, 3.5, 2.5), range_max=3.0)


@pytest.fixture(scope="module")
def robot() -> Any:
    return qpsafe.load_robot("irb140")


def test_all_ways_to_write_the_same(tmp_path: Path, robot: Any) -> None:
    rng = np.random.default_rng(0)
    q, z = rng.uniform(-1.0, 1.0, (6, 6)), np.round(rng.uniform(0.5, 4.0, (6, 6, 8)), 3)
    z[:, 0, 0] = 0.0
    units = np.rint(1000.0 * z).astype(np.uint16)
    along = np.where(z > 0.0, z, np.nan).reshape(6, -1) / SENSOR.directions[:, 2]
    times = np.arange(6.0)
    ways = {
        "metres": {"q": q, "depth": z},
        "units": {"q": q, "depth": units},
        "scaled": {"q": q, "depth": (2 * units).astype(np.uint16), "scale": 0.0005},
        "distances": {"q": q, "distances": along},
        "as images": {"q": q, "distances": along.reshape(6, 6, 8)},
        "stamped": {"q": q, "q_stamps": times, "stamps": times, "depth": z},
    }
    told = []
    for name, table in ways.items():
        np.savez(tmp_path / f"{name}.npz", **table)
        told.append(load_recording(tmp_path / f"{name}.npz", SENSOR, robot))
    folder = tmp_path / "folder"
    folder.mkdir()
    for k in range(6):
        np.savez(folder / f"{k:03}.npz", q=q[k], depth=units[k])
    told.append(load_recording(folder, SENSOR, robot))
    for recording in told:
        assert recording.distances == pytest.approx(told[0].distances, abs=1e-9, nan_ok=True)
        assert np.array_equal(recording.q, q)
    assert np.isnan(told[0].distances[:, 0]).all()
    assert np.isinf(told[0].distances[along > 3.0]).all()


def test_joints_are_interpolated(tmp_path: Path, robot: Any) -> None:
    q = np.outer([0.0, 1.0], np.ones(6))
    stamps = np.linspace(0.0, 1.0, 6)
    np.savez(tmp_path / "r.npz", q=q, q_stamps=[0.0, 1.0], stamps=stamps, depth=np.ones((6, 6, 8)))
    assert load_recording(tmp_path / "r.npz", SENSOR, robot).q[:, 2] == pytest.approx(stamps)


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"q": None}, "q = "),
        ({"depth": None}, "depth = "),
        ({"depth": np.ones((6, 5, 8))}, "depth = "),
        ({"depth": np.full((6, 6, 8), "x")}, "depth = "),
        ({"q": np.zeros((6, 5))}, "q = "),
        ({"q": np.full((6, 6), np.nan)}, "q = "),
        ({"q": np.zeros((5, 6))}, "q = "),
        ({"q": np.zeros((4, 6)), "depth": np.ones((4, 6, 8))}, "images = 4"),
        ({"q_stamps": np.arange(6.0)}, "stamps = "),
        ({"q_stamps": np.zeros(6), "stamps": np.zeros(6)}, "q_stamps = "),
        ({"q_stamps": np.arange(6.0), "stamps": np.arange(6.0) + 1.0}, "stamps = "),
        ({"depth": None, "distances": np.ones((6, 47))}, "distances = "),
        ({"depth": None, "distances": np.array(1.0)}, "distances = "),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, robot: Any, changed: dict[str, Any], word: str) -> None:
    table = {"q": np.zeros((6, 6)), "depth": np.ones((6, 6, 8))} | changed
    np.savez(tmp_path / "r.npz", **{key: value for key, value in table.items() if value is not None})
    with pytest.raises(ConfigurationError, match=rf"r\.npz: {word}"):
        load_recording(tmp_path / "r.npz", SENSOR, robot)


def test_what_is_no_file_is_named(tmp_path: Path, robot: Any) -> None:
    (tmp_path / "bad.npz").write_bytes(b"no zip")
    np.savez(tmp_path / "objects.npz", q=np.array([{}], dtype=object), depth=np.ones(1))
    (tmp_path / "empty").mkdir()
    for name in ("bad.npz", "objects.npz", "none.npz", "empty"):
        with pytest.raises(ConfigurationError, match=name):
            load_recording(tmp_path / name, SENSOR, robot)


CELL = """# my cell
[[box]]
name = "table"          # of oak
size = [0.8, 1.2, 0.05]
centre = [0.9, 0.0, 0.1]

[[camera]]
kind = "array"
{first}name = "one"
zones = [8, 8]
field_of_view = 45.0
range_max = 4.0
rate = 15.0

[[camera]]
name = "two"  # on the wall
kind = "array"
zones = [8, 8]
field_of_view = 45.0
{second}range_max = 4.0
rate = 15.0
"""


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize(
    "before",
    ["position = [0.0, 0.0, 1.0]\nlook_at = [1.0, 0.0, 1.0]\n",
     "look_at = [1.0,\n  0.0,   # ahead\n  1.0,\n]\nup = [0.0, 0.0, 1.0]\nposition = [0.0, 0.0, 1.0]\n"],
)  # fmt: skip
def test_a_pose_is_put_into_the_text_and_nothing_else_changes(tmp_path: Path, number: int, before: str) -> None:
    text = CELL.format(first=before, second=before)
    pose = looking((1.2345, -0.5, 2.0), (0.1, 0.2, 0.3))
    changed = with_pose(text, number, pose, "measured")
    path = tmp_path / "cell.toml"
    path.write_text(changed)
    cameras = load_cameras(path)
    assert cameras[number].pose == pytest.approx(pose, abs=1e-5)
    path.write_text(text)
    old = load_cameras(path)
    assert np.array_equal(cameras[1 - number].pose, old[1 - number].pose)
    gone = set(text.splitlines()) - set(changed.splitlines())
    assert all(line in before for line in gone)
    assert with_pose(changed, number, pose, "measured") == changed
    # where there was none
    path.write_text(with_pose(with_pose(CELL.format(first="", second=""), 0, pose), 1, pose))
    assert [camera.pose == pytest.approx(pose, abs=1e-5) for camera in load_cameras(path)] == [True, True]


ALTERED: dict[str, dict[str, Any]] = {
    "scale in words": {"scale": "mm"}, "scale nothing": {"scale": np.empty(0)}, "scale none": {"scale": np.nan},
    "scale zero": {"scale": 0.0}, "scales": {"scale": [0.001, 0.001]},
    "no times": {"q": np.empty((0, 6)), "q_stamps": np.empty(0), "stamps": np.zeros(6)},
    "no stamps": {"q_stamps": np.arange(6.0), "stamps": np.empty(0)},
    "stamps of no number": {"q_stamps": np.arange(6.0), "stamps": np.full(6, np.nan)},
    "nothing": {"q": np.empty((0, 6)), "depth": np.empty((0, 6, 8))},
    "no axes": {"depth": 1.0}, "distances of no axes": {"distances": 1.0}, "text": {"depth": np.full((6, 6, 8), "x")},
}  # fmt: skip


@pytest.mark.parametrize("what", ALTERED)
def test_what_is_wrong_in_a_recording_is_named(tmp_path: Path, robot: Any, what: str) -> None:
    usual = {"q": np.zeros((6, 6)), "depth": np.full((6, 6, 8), 900, dtype=np.uint16)}
    np.savez(tmp_path / "r.npz", **(usual | ALTERED[what]))
    with pytest.raises(ConfigurationError, match=r"r\.npz"):
        load_recording(tmp_path / "r.npz", SENSOR, robot)


def test_a_recording_with_broken_bytes_is_named_or_read(tmp_path: Path, robot: Any) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "r.npz"
    np.savez_compressed(path, q=rng.normal(size=(6, 6)), depth=rng.integers(300, 3000, (6, 6, 8)).astype(np.uint16))
    whole = path.read_bytes()
    for _ in range(300):
        broken = bytearray(whole)
        for place in rng.integers(0, len(whole), int(rng.integers(1, 4))).tolist():
            broken[place] = int(rng.integers(0, 256))
        path.write_bytes(bytes(broken[: int(rng.integers(1, len(whole) + 1))] if rng.random() < 0.3 else broken))
        with suppress(ConfigurationError):
            load_recording(path, SENSOR, robot)


def test_images_of_a_folder_have_one_scale(tmp_path: Path, robot: Any) -> None:
    for k in range(6):
        scale = 0.001 if k < 5 else 0.0001
        np.savez(tmp_path / f"{k}.npz", q=np.zeros(6), depth=np.full((6, 8), round(1 / scale), np.uint16), scale=scale)
    with pytest.raises(ConfigurationError, match="scale"):
        load_recording(tmp_path, SENSOR, robot)
