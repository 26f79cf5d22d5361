"""A robot's folder written in another place: whatever its model refers to, and wherever the copy goes, it loads."""

from __future__ import annotations

import struct
import tomllib
import warnings
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from amounts import first
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import bundled_robots, load_quietly
from qpsafe.robot.robot import Robot
from qpsafe.robot.robot_file.starting_file import starting_robot_toml
from qpsafe.sensing.skin.spots import load_spots
from qpsafe.sim.experiments.shared.folder import copied_folder, with_keys
from qpsafe.sim.experiments.shared.skin import skin_toml
from qpsafe.sim.tuning.robot_file import farthest, write_folder
from qpsafe.sim.tuning.space import Space
from qpsafe.sim.tuning.values import present

pytestmark = pytest.mark.long

MESHES = ("link.stl", "../meshes/link.stl", "package://made_up_support/meshes/link.stl")


def cube(path: Path, size: float = 0.1) -> None:
    """A binary STL of a cube from 0 to its size in x and y, and to three times that in z."""
    corners = size * np.array([[i & 1, i >> 1 & 1, 3 * (i >> 2)] for i in range(8)], dtype=float)
    faces = np.array([0, 1, 3, 0, 3, 2, 4, 7, 5, 4, 6, 7, 0, 5, 1, 0, 4, 5, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4])
    faces = np.concatenate((faces, [1, 5, 7, 1, 7, 3])).reshape(12, 3)
    path.parent.mkdir(parents=True, exist_ok=True)
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in faces)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(faces)) + body)


def package(folder: Path, mesh: str, joints: int = 6) -> Path:
    """A package of ROS with an arm whose links are meshes; the URDF."""
    root = folder / "made_up_support"
    cube(root / ("urdf" if "/" not in mesh else "meshes") / "link.stl")
    shape = f'<collision><geometry><mesh filename="{mesh}"/></geometry></collision>'
    links, rest = f'<link name="l0">{shape}</link>', ""
    for i in range(1, joints + 1):
        axis = "0 1 0" if i in (2, 3, 5) else "0 0 1"
        links += f'<link name="l{i}">{shape}</link>'
        rest += (
            f'<joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/>'
            f'<origin xyz="0 0 0.3"/><axis xyz="{axis}"/>'
            '<limit lower="-2.8" upper="2.8" velocity="3" effort="0"/></joint>'
        )
    file = root / "urdf" / "arm.urdf"
    file.parent.mkdir(exist_ok=True)
    file.write_text(f'<robot name="arm">{links}{rest}</robot>', encoding="utf-8")
    return file


@cache
def skin(joints: int) -> str:
    """Sensors for the arm, chosen once: its shapes are the same wherever its meshes lie."""
    with TemporaryDirectory() as folder:
        file = package(Path(folder), MESHES[0], joints)
        (file.parent / "robot.toml").write_text(starting_robot_toml(load_quietly(file), file.parent), encoding="utf-8")
        return skin_toml(load_quietly(file.parent))[0]


def described(file: Path) -> Robot:
    """The robot of a folder that is the model's own, as `qpsafe robots add` writes it by default."""
    text = starting_robot_toml(load_quietly(file), file.parent, spots="spots.toml")
    (file.parent / "robot.toml").write_text(text, encoding="utf-8")
    (file.parent / "spots.toml").write_text(skin(load_quietly(file.parent).nq), encoding="utf-8")
    return load_quietly(file.parent)


@pytest.mark.parametrize("mesh", first(1, MESHES))
def test_a_tuned_copy_finds_its_meshes_wherever_it_is(mesh: str, tmp_path: Path) -> None:
    robot = described(package(tmp_path / "ws", mesh))
    values = Space.of(robot).at(Space.of(robot).near(np.random.default_rng(0), 0.2))
    beside, inside = tmp_path / "far" / "away" / "robot", robot.folder / "out" / "tuned" / "robot"
    for place in (beside, inside, inside):  # the last one replaces a copy that is in the folder itself
        copy = load_quietly(write_folder(robot, values, "a run", place))
        assert farthest(present(copy), values) < 1e-12
        assert [(b, n) for b, n, _ in copy.hulls()] == [(b, n) for b, n, _ in robot.hulls()]
        np.testing.assert_array_equal(load_spots(copy).positions, load_spots(robot).positions)
        assert sorted(p.name for p in place.iterdir()) == ["robot.toml", "spots.toml"]
    again = load_quietly(write_folder(copy, values, "another", tmp_path / "third"))  # of a copy, once more
    assert again.model_path == robot.model_path.resolve()


@pytest.mark.parametrize("name", bundled_robots())
def test_of_a_bundled_robot_everything_is_copied(name: str, tmp_path: Path) -> None:
    robot = load_quietly(name)
    folder = copied_folder(robot, tmp_path / "copy")
    assert {p.name for p in folder.iterdir()} == {p.name for p in robot.folder.iterdir()} - {"__pycache__"}
    assert load_quietly(folder).model_path.parent == folder


@pytest.mark.slow
def test_sensors_of_another_kind_and_meshes_of_regions_go_along(tmp_path: Path) -> None:
    robot = described(package(tmp_path, MESHES[1]))
    (robot.folder / "spots-vl53l5cx.toml").write_text("# arrays\n")
    cube(robot.folder / "covers" / "cover.stl")
    file = robot.folder / "robot.toml"
    region = '\n[[regions]]\nname = "x"\nlink = 3\nframe = "l2"\nlower = [-1.0, -1.0, -1.0]\nupper = [1.0, 1.0, 1.0]\n'
    file.write_text(file.read_text() + region + 'mesh = "covers/cover.stl"\n')
    folder = copied_folder(load_quietly(robot.folder), tmp_path / "copy")
    assert (folder / "spots-vl53l5cx.toml").read_text() == "# arrays\n"
    assert load_quietly(folder).regions[0].mesh == folder / "covers" / "cover.stl"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_quietly(folder)


@pytest.mark.parametrize("bundled", [False, True])
def test_nothing_of_anybody_elses_is_deleted(bundled: bool, tmp_path: Path) -> None:
    robot = load_quietly("irb140") if bundled else described(package(tmp_path / "ws", MESHES[1]))
    place = tmp_path / "results" / "robot"
    (place / "notes").mkdir(parents=True)
    (place / "notes" / "mine.txt").write_text("mine")
    (place / "spots-by-hand.toml").write_text("# of an earlier robot\n")
    copied_folder(robot, place)
    assert (place / "notes" / "mine.txt").read_text() == "mine"
    assert (place / "spots-by-hand.toml").exists() == (robot.folder / "spots-by-hand.toml").exists()


@pytest.mark.parametrize("up", first(1, [0, 1]))
def test_a_copy_over_the_robot_itself_is_refused_and_leaves_it_as_it_is(up: int, tmp_path: Path) -> None:
    robot = described(package(tmp_path, MESHES[1]))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    place = (robot.folder, *robot.folder.parents)[up]
    with pytest.raises(ConfigurationError, match="the files of arm lie there"):
        copied_folder(robot, place)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


WORDS = st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")), min_size=1, max_size=20)


@given(WORDS, WORDS, st.booleans(), st.booleans())
def test_keys_are_stated_anew_and_nothing_else_changes(model: str, spots: str, there: bool, comment: bool) -> None:
    text = "# an arm\nname = 'model = 1'\nmodel = 'arm.urdf'  # beside\n" + "# spots = 'none'\n" * comment
    text += "spots = 'old.toml'\n" * there + "\n[frames]\nmodel = 'a'\nspots = 'b'\n"
    found = with_keys(text, {"model": model, "spots": spots})
    if found is None:  # what JSON and TOML write differently is refused, not written
        assert max(map(ord, model + spots)) > 0xFFFF
        return
    assert tomllib.loads(found) == tomllib.loads(text) | {"model": model, "spots": spots}
    assert found.startswith("# an arm\nname = 'model = 1'\n")


def test_what_cannot_be_edited_by_lines_is_refused() -> None:
    assert with_keys('name = "x"\nmodel = """\narm.urdf"""\n', {"model": "b"}) is None
