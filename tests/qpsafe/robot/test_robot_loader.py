"""`load_robot`: by name, folder, MJCF or URDF."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from qpsafe.errors import RobotFileError, RobotWarning
from qpsafe.robot.loader import bundled_robots, load_robot

pytestmark = pytest.mark.filterwarnings("ignore::qpsafe.errors.RobotWarning")

IRB140 = load_robot("irb140")

URDF = """
<robot name="planar">
  <link name="base"/>
  {links}
  <joint name="shoulder" type="{kind}">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" velocity="3" effort="4"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="fore"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit lower="0.5" upper="2" velocity="{velocity}" effort="4"/>
  </joint>
  <joint name="mount" type="fixed"><parent link="fore"/><child link="tip"/><origin xyz="0.25 0 0"/></joint>
</robot>
"""
INERTIA = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
LINKS = "".join(f'<link name="{name}">{INERTIA}</link>' for name in ("upper", "fore", "tip"))


def urdf(folder: Path, kind: str = "revolute", velocity: str = "3") -> Path:
    path = folder / "planar.urdf"
    path.write_text(URDF.format(links=LINKS, kind=kind, velocity=velocity), encoding="utf-8")
    return path


def test_bundled_robots_all_load() -> None:
    assert "irb140" in bundled_robots()
    for name in bundled_robots():
        assert load_robot(name).name == name


def test_an_unknown_name_lists_the_bundled_ones() -> None:
    with pytest.raises(RobotFileError) as caught:
        load_robot("irb6700")
    assert "irb6700" in str(caught.value)
    assert all(name in str(caught.value) for name in bundled_robots())


def test_name_folder_and_file_are_the_same_robot() -> None:
    for path in (IRB140.folder, str(IRB140.folder), IRB140.folder / "robot.toml"):
        robot = load_robot(path)
        assert (robot.name, robot.frame_names, robot.model_path) == ("irb140", IRB140.frame_names, IRB140.model_path)


def test_a_folder_s_limits_are_not_overridden_silently() -> None:
    with pytest.raises(RobotFileError, match="max_velocity"):
        load_robot("irb140", max_velocity=1.0)


def test_a_bare_mjcf_gets_a_slow_speed_and_says_so() -> None:
    with pytest.warns(RobotWarning, match="no speed limit in the file, 1 rad/s is taken: joint_1, "):
        robot = load_robot(IRB140.model_path)
    np.testing.assert_array_equal(robot.max_velocity, 1.0)
    assert any("joint_6" in note for note in robot.notes)


def test_a_bare_mjcf_has_the_same_kinematics_as_its_folder() -> None:
    robot = load_robot(IRB140.model_path, max_velocity=[1, 2, 3, 4, 5, 6], max_acceleration=7.0, home=IRB140.home)
    np.testing.assert_array_equal(robot.max_velocity, [1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(robot.max_acceleration, 7.0)
    np.testing.assert_allclose(robot.lower, IRB140.lower, rtol=1e-15)
    np.testing.assert_allclose(robot.upper, IRB140.upper, rtol=1e-15)
    np.testing.assert_allclose(robot.pose("tcp", IRB140.home), IRB140.pose("tcp", IRB140.home), rtol=0, atol=1e-14)
    wire = robot.wire(IRB140.home, np.zeros(6))
    np.testing.assert_allclose(wire.ends[-1], IRB140.pose("tcp", IRB140.home)[:3, 3], atol=1e-15)
    np.testing.assert_array_equal(wire.starts[1:], wire.ends[:-1])  # one chain from the base to the tip


def test_a_urdf_against_plane_trigonometry(tmp_path: Path) -> None:
    robot = load_robot(urdf(tmp_path))
    assert robot.joint_names == ("shoulder", "elbow")
    np.testing.assert_array_equal(robot.lower, [-1, 0.5])
    np.testing.assert_array_equal(robot.max_velocity, [3, 3])
    np.testing.assert_array_equal(robot.max_acceleration, 12.0)  # full speed in 0.25 s
    np.testing.assert_array_equal(robot.home, [0, 0.5])  # zero, moved inside the limits
    a, b = 0.3, 0.9
    tip = [0.5 * np.cos(a) + 0.25 * np.cos(a + b), 0.5 * np.sin(a) + 0.25 * np.sin(a + b), 0.0]
    np.testing.assert_allclose(robot.pose("tip", [a, b])[:3, 3], tip, rtol=0, atol=1e-15)
    wire = robot.wire([a, b], [1.0, 0.0])
    np.testing.assert_allclose(wire.ends[-1], tip, rtol=0, atol=1e-15)
    np.testing.assert_allclose(wire.end_velocities[-1], [-tip[1], tip[0], 0.0], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("keyword", "value", "key"),
    [
        ("lower", 3.0, "shoulder.lower"),
        ("upper", [2.0, np.nan], "elbow.upper"),
        ("max_velocity", -1.0, "shoulder.max_velocity"),
        ("max_velocity", [1.0, 2.0, 3.0], "max_velocity"),
        ("max_velocity", "fast", "max_velocity"),
        ("max_acceleration", [1.0, 0.0], "elbow.max_acceleration"),
        ("max_acceleration", np.inf, "shoulder.max_acceleration"),
        ("home", [0.0, 0.0], "elbow.home"),
        ("home", [np.nan, 1.0], "shoulder.home"),
    ],
)
def test_wrong_overrides_are_named(tmp_path: Path, keyword: str, value: object, key: str) -> None:
    with pytest.raises(RobotFileError) as caught:
        load_robot(urdf(tmp_path), **{keyword: value})
    assert caught.value.key == key


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "MJCF or URDF"),
        ("<mujoco>", "MJCF or URDF"),
        ("<sdf/>", "<mujoco>"),
        ("<mujoco/>", ""),
        ("<robot name='r'><link name='a'/></robot>", "joint"),
        ("\x00\x01", "MJCF or URDF"),
    ],
)
def test_files_that_are_no_robot_are_errors(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "some.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    assert caught.value.where == str(path)
    assert expected in caught.value.expected


def test_a_robot_can_be_sent_to_another_process(tmp_path: Path) -> None:
    from qpsafe.sensing.body import body_hulls

    for path in (IRB140.folder, IRB140.model_path, urdf(tmp_path)):  # bundled, compiled by MuJoCo, URDF
        robot = load_robot(path)
        sent = pickle.loads(pickle.dumps(robot))
        np.testing.assert_array_equal(
            sent.pose(robot.frame_names[-1], robot.home), robot.pose(robot.frame_names[-1], robot.home)
        )
        for (*_, points), (*_, own) in zip(body_hulls(sent), body_hulls(robot), strict=True):
            np.testing.assert_array_equal(points, own)


def test_a_toml_elsewhere_describes_a_model_file(tmp_path: Path) -> None:
    """The same robot, its robot.toml apart from its model."""
    path = tmp_path / "mine.toml"
    path.write_text((IRB140.folder / "robot.toml").read_text(encoding="utf-8"), encoding="utf-8")
    robot = load_robot(IRB140.model_path, path)
    assert robot.model_path == IRB140.model_path
    for name in ("lower", "upper", "max_velocity", "max_acceleration", "home", "dh"):
        np.testing.assert_array_equal(getattr(robot, name), getattr(IRB140, name))
    assert robot.wire_frames == IRB140.wire_frames
    assert [note[:41] for note in robot.notes] == ["spots.toml, which mine.toml names, is not"]
    with pytest.raises(RobotFileError, match="max_velocity"):
        load_robot(IRB140.model_path, path, max_velocity=1.0)


@pytest.mark.parametrize("name", bundled_robots())
def test_a_starting_toml_loads_as_the_bare_robot(name: str, tmp_path: Path) -> None:
    """What `qpsafe robots add` writes says what was loaded: limits, frames, wire, home."""
    from qpsafe.robot.robot_file.starting_file import starting_robot_toml

    bare = load_robot(load_robot(name).model_path)
    (tmp_path / "robot.toml").write_text(starting_robot_toml(bare, tmp_path), encoding="utf-8")
    robot = load_robot(tmp_path)
    assert robot.wire_frames == bare.wire_frames
    assert robot.frame_names == bare.frame_names
    assert set(robot.tool_frames) == set(bare.tool_frames)
    for key in ("lower", "upper", "max_velocity", "max_acceleration", "home"):
        np.testing.assert_allclose(getattr(robot, key), getattr(bare, key), rtol=0, atol=1e-7)


def test_collision_bodies_of_a_urdf_with_a_held_joint_are_found(tmp_path: Path) -> None:
    """Self-detection works on what is left when a joint is held."""
    from qpsafe.sensing.body import body_hulls

    path = urdf(tmp_path, kind="prismatic")
    box = '<link name="fore"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    path.write_text(path.read_text(encoding="utf-8").replace('<link name="fore">', box), encoding="utf-8")
    ((body, _, corners),) = body_hulls(load_robot(path, hold={"shoulder": 0.7}))
    assert body == 1
    np.testing.assert_allclose(np.abs(corners), 0.05, atol=1e-12)


MESH = '<link name="fore"><collision><geometry><mesh filename="{}"/></geometry></collision>'


def obj(path: Path, size: float) -> None:
    """A tetrahedron with edges of this length along the axes."""
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in np.vstack((np.zeros(3), size * np.eye(3))))
    path.write_text(corners + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", encoding="utf-8")


@pytest.mark.parametrize("given", ["arm/planar.urdf", "arm", "arm/robot.toml", "arm/../arm/planar.urdf"])
def test_a_robot_keeps_to_its_files_wherever_the_program_goes(
    given: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is read later is what was found at first; another folder has files of the same names."""
    from qpsafe.robot.robot_file.starting_file import starting_robot_toml

    for name, size in (("here", 0.1), ("there", 0.5)):
        folder = tmp_path / name / "arm"
        folder.mkdir(parents=True)
        path = urdf(folder)
        path.write_text(path.read_text("utf-8").replace('<link name="fore">', MESH.format("part.obj")), "utf-8")
        obj(folder / "part.obj", size)
        obj(tmp_path / name / "part.obj", 3.0 * size)
        (folder / "spots.toml").touch()
        text = starting_robot_toml(load_robot(path), folder, spots="spots.toml")
        (folder / "robot.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path / "here")
    robot = load_robot(given)
    other = robot.with_spots("arm/spots.toml")
    described = load_robot("arm/planar.urdf", "arm/robot.toml")
    monkeypatch.chdir(tmp_path / "there")
    for one in (robot, described):
        ((_, _, points),) = one.hulls()
        np.testing.assert_allclose(np.ptp(points, axis=0), 0.1, rtol=1e-6)
    own = tmp_path / "here" / "arm"
    for path in (robot.folder, robot.model_path.parent, described.folder, other.spots_path.parent):
        assert path.is_absolute()
        assert path.samefile(own)


@pytest.mark.parametrize("name", ["irb140", IRB140.folder, IRB140.folder / "robot.toml"])
@pytest.mark.parametrize("toml", ["/nowhere.toml", IRB140.folder / "robot.toml"])
def test_a_robot_that_has_a_robot_toml_takes_no_other_one(name: str | Path, toml: str | Path) -> None:
    with pytest.raises(RobotFileError) as caught:
        load_robot(name, toml)
    assert (caught.value.key, caught.value.value) == ("toml", str(toml))


def test_a_sensor_file_that_is_named_and_missing_is_an_error_but_for_the_usual_name(tmp_path: Path) -> None:
    from qpsafe.robot.robot_file.starting_file import starting_robot_toml

    bare = load_robot(urdf(tmp_path))
    for name in ("spot.toml", "spots-tof.toml", "sensors/spots.toml", "x" * 300):
        text = starting_robot_toml(bare, tmp_path, spots=name)
        (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
        with pytest.raises(RobotFileError) as caught:
            load_robot(tmp_path)
        assert (caught.value.where, caught.value.key) == (str(tmp_path / "robot.toml"), "spots")
        assert caught.value.value == name
    text = starting_robot_toml(bare, tmp_path, spots="spots.toml")
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    assert load_robot(tmp_path).spots_path is None
