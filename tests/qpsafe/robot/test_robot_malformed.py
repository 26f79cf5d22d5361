"""Malformed robot files, URDF and MJCF: each is an error that names the place, or a note where it is only doubtful."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from qpsafe.errors import RobotFileError, RobotWarning
from qpsafe.robot.loader import load_robot

INERTIA = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
URDF = f"""<robot name="two">
  <link name="base"/>
  <link name="upper">{INERTIA}</link>
  <link name="fore">{INERTIA}<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" velocity="3" effort="4"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="fore"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="4"/>
  </joint>
  <link name="tip"/>
  <joint name="mount" type="fixed"><parent link="fore"/><child link="tip"/><origin xyz="0.25 0 0"/></joint>
</robot>
"""
ELBOW = URDF[URDF.index('  <joint name="elbow"') : URDF.index('  <link name="tip"/>')]
LOOP = '<joint name="loop" type="fixed"><parent link="tip"/><child link="base"/></joint>'

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'

# what is changed -> old text, new text, words of the place, words of what was expected
WRONG_URDF = {
    "not XML": ("</robot>", "", "file", "MJCF or URDF"),
    "missing mesh": ('<box size="0.1 0.1 0.3"/>', '<mesh filename="meshes/fore.stl"/>', "link fore", "a file that is"),
    "missing mesh of a package": (
        '<box size="0.1 0.1 0.3"/>',
        '<mesh filename="package://two_description/fore.stl"/>',
        "link fore: collision mesh",
        "package://",
    ),
    "cyclic tree": ("</robot>", LOOP + "</robot>", "joint", "base -> upper -> fore -> tip -> base"),
    "two parents": (
        "</robot>",
        '<joint name="second" type="fixed"><parent link="base"/><child link="fore"/></joint></robot>',
        "joint second: child",
        "joint elbow already carries it",
    ),
    "two trees": ("</robot>", '<link name="lost"/></robot>', "link lost", "one tree"),
    "unknown link": ('<child link="fore"/>', '<child link="four"/>', "joint elbow: child", "base, upper, fore, tip"),
    "no child": ('<child link="fore"/>', "", "joint elbow: child", "a link of the file"),
    "NaN inertia": ('ixx="1"', 'ixx="nan"', "link upper: inertia ixx", "finite"),
    "impossible inertia": ('ixx="1"', 'ixx="-1"', "link upper: inertia", ">= 0"),
    "negative mass": ('mass value="1"', 'mass value="-1"', "link upper: mass", ">= 0"),
    "axis of zeros": ('axis xyz="0 1 0"', 'axis xyz="0 0 0"', "joint elbow: axis", "direction"),
    "axis in two dimensions": ('axis xyz="0 1 0"', 'axis xyz="0 1"', "joint elbow: axis", "3 finite numbers"),
    "axis that is no number": ('axis xyz="0 1 0"', 'axis xyz="0 y 0"', "joint elbow: axis", "3 finite numbers"),
    "NaN origin": ('xyz="0.5 0 0"', 'xyz="nan 0 0"', "joint elbow: origin xyz", "3 finite numbers"),
    "duplicate joint names": (ELBOW, ELBOW + ELBOW, "joint elbow: name", "another joint"),
    "duplicate link names": ('<link name="tip"/>', '<link name="fore"/>', "link fore: name", "another link"),
    "nameless joint": ('joint name="elbow"', "joint", "joint number 2: name", "a name"),
    "unknown kind of joint": ('"elbow" type="revolute"', '"elbow" type="hinge"', "joint elbow: type", "revolute"),
    "no limits": ('<limit lower="-2" upper="2" velocity="3" effort="4"/>', "", "joint elbow: limit", "<limit>"),
    "limits the wrong way round": ('lower="-2"', 'lower="3"', "joint elbow: limit lower", "upper = 2.0"),
    "limits without room": ('lower="-2" upper="2"', 'lower="0" upper="0"', "elbow.lower", "less than upper"),
    "NaN speed": ('lower="-2" upper="2" velocity="3"', 'lower="-2" upper="2" velocity="nan"', "joint elbow", "number"),
    "no name": ('robot name="two"', "robot", "robot: name", "a name"),
    "left-over of xacro": ("</robot>", f"<xacro:arm {XACRO}/></robot>", "<xacro:arm>", "run xacro first"),
    "left-over expression": ('xyz="0.5 0 0"', 'xyz="${length} 0 0"', "<origin>: xyz", "run xacro first"),
    "left-over substitution": (
        '<box size="0.1 0.1 0.3"/>',
        '<mesh filename="$(find two)/a.stl"/>',
        "<mesh>",
        "run xacro",
    ),
    "NaN damping": ("</joint>", '<dynamics damping="nan"/></joint>', "joint shoulder: dynamics damping", "finite"),
    "no damping": ("</joint>", "<dynamics/></joint>", "joint shoulder: dynamics", "damping or friction"),
    "no k_velocity": ("</joint>", "<safety_controller/></joint>", "shoulder: safety_controller k_velocity", "finite"),
    "word as soft limit": (
        "</joint>",
        '<safety_controller k_velocity="1" soft_upper_limit="x"/></joint>',
        "joint shoulder: safety_controller soft_upper_limit",
        "finite",
    ),
    "mimic of nothing": ("</joint>", '<mimic joint="knee"/></joint>', "joint shoulder: mimic joint", "another"),
    "mimic of itself": ("</joint>", '<mimic joint="shoulder"/></joint>', "joint shoulder: mimic joint", "another"),
    "mimic by a word": ("</joint>", '<mimic joint="elbow" offset="x"/></joint>', "shoulder: mimic offset", "finite"),
    "mimic in the chain": (
        '<axis xyz="0 1 0"/>',
        '<axis xyz="0 1 0"/><mimic joint="shoulder"/>',
        "joint elbow",
        "moves on its own",
    ),
    "box without size": ('<box size="0.1 0.1 0.3"/>', "<box/>", "link fore: collision box size", "3 finite"),
    "ball of no size": ('<box size="0.1 0.1 0.3"/>', '<sphere radius="0"/>', "collision sphere radius", "more than 0"),
    "unknown shape": ('<box size="0.1 0.1 0.3"/>', "<cone/>", "link fore: collision geometry", "box"),
    "NaN place of a shape": ("<geometry>", '<origin rpy="0 nan 0"/><geometry>', "collision: origin rpy", "finite"),
    "negative effort": ('velocity="3" effort="4"', 'velocity="3" effort="-4"', "shoulder: limit effort", ">= 0"),
    "negative speed": ('velocity="3" effort="4"', 'velocity="-3" effort="4"', "shoulder: limit velocity", ">= 0"),
    "no mass": ('<mass value="1"/>', "", "link upper: mass", "finite"),
    "no moments": ('ixx="1"', "", "link upper: inertia ixx", "finite"),
    "no links": (URDF, '<robot name="r"/>', "link", "at least one"),
    "no joints": (URDF, '<robot name="r"><link name="a"/></robot>', "joints", "at least one"),
}

MJCF = """<mujoco model="two">
  <worldbody>
    <body name="base">
      <body name="upper">
        <joint name="shoulder" axis="0 0 1" range="-60 100" limited="true"/>
        <geom name="bar" type="capsule" fromto="0 0 0 0.5 0 0" size="0.03"/>
        <body name="fore" pos="0.5 0 0">
          <joint name="elbow" axis="0 1 0" range="-100 100" limited="true"/>
          <geom type="box" size="0.05 0.05 0.1"/>
          <site name="tip" pos="0.25 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
BOX = '<geom type="box" size="0.05 0.05 0.1"/>'
WRONG_MJCF = {
    "not XML": ("</mujoco>", "", "file", "MJCF or URDF"),
    "missing mesh": (
        "<worldbody>",
        '<asset><mesh name="m" file="fore.stl"/></asset><worldbody>',
        "file",
        "fore.stl",
    ),
    "unknown mesh": (BOX, '<geom type="mesh" mesh="none"/>', "file", "none"),
    "duplicate joint names": ('name="elbow"', 'name="shoulder"', "file", "shoulder"),
    "duplicate body names": ('name="fore"', 'name="upper"', "file", "upper"),
    "NaN inertia": (
        BOX,
        '<inertial pos="0 0 0" mass="1" diaginertia="nan 1 1"/>',
        "<inertial>: diaginertia",
        "finite",
    ),
    "impossible inertia": (BOX, '<inertial pos="0 0 0" mass="1" diaginertia="1 1 9"/>', "file", "MuJoCo"),
    "axis of zeros": ('axis="0 1 0"', 'axis="0 0 0"', "file", "axis"),
    "NaN axis": ('axis="0 1 0"', 'axis="0 nan 0"', "<joint> elbow: axis", "finite"),
    "NaN place": ('pos="0.5 0 0"', 'pos="nan 0 0"', "<body> fore: pos", "finite"),
    "range the wrong way round": ('range="-100 100"', 'range="100 -100"', "file", "range"),
    "unknown element": (BOX, "<motor/>", "file", "motor"),
    "joints that move one another": (
        "</worldbody>",
        '</worldbody><equality><joint joint1="shoulder" joint2="elbow"/></equality>',
        "joint shoulder",
        "moves on its own",
    ),
    "a closed loop in the chain": (
        "</worldbody>",
        '</worldbody><equality><connect body1="fore" anchor="0 0 0"/></equality>',
        "joint elbow",
        "moves on its own",
    ),
    "a plane as a body": (BOX, '<geom name="p" type="plane" size="1 1 1"/>', "file", "plane"),
    "no joints": (MJCF, '<mujoco><worldbody><body name="a"/></worldbody></mujoco>', "joints", "at least one"),
}


def changed(folder: Path, text: str, old: str, new: str) -> Path:
    assert old in text, old
    text = text.replace(old, new, 1)
    path = folder / ("two.urdf" if "<robot" in text else "two.xml")
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("mistake", WRONG_URDF)
def test_a_wrong_urdf_is_an_error_that_names_the_place(mistake: str, tmp_path: Path) -> None:
    old, new, key, expected = WRONG_URDF[mistake]
    check(changed(tmp_path, URDF, old, new), key, expected)


@pytest.mark.parametrize("mistake", WRONG_MJCF)
def test_a_wrong_mjcf_is_an_error_that_names_the_place(mistake: str, tmp_path: Path) -> None:
    old, new, key, expected = WRONG_MJCF[mistake]
    check(changed(tmp_path, MJCF, old, new), key, expected)


def check(path: Path, key: str, expected: str) -> None:
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    error = caught.value
    assert error.where == str(path)
    assert key in error.key
    assert expected in error.expected
    assert "\n" not in str(error)


@pytest.mark.parametrize("text", [URDF, MJCF])
def test_the_unchanged_files_load_with_notes(text: str, tmp_path: Path) -> None:
    path = changed(tmp_path, text, text, text)
    with pytest.warns(RobotWarning, match="full speed in 0.25 s"):
        robot = load_robot(path)
    assert robot.joint_names == ("shoulder", "elbow")
    assert robot.tool_frames == ("tip",)
    np.testing.assert_allclose(robot.max_acceleration, 4.0 * robot.max_velocity)


# what is changed -> old text, new text, words of the note
DOUBTFUL_URDF = {
    "infinite speed": ('"2" velocity="3"', '"2" velocity="inf"', "1 rad/s is taken: shoulder"),
    "no speed": ('upper="2" velocity="3"', 'upper="2"', "no speed limit"),
    "zero inertia": (INERTIA, "", "no mass or inertia is given for what moves: upper"),
    "endless joint": ('"elbow" type="revolute"', '"elbow" type="continuous"', "±1000 turns: elbow"),
    "joint of no kind": ('"elbow" type="revolute"', '"elbow" type="floating"', "in place: elbow (floating)"),
}  # fmt: skip
DOUBTFUL_MJCF = {
    "no speeds": (MJCF, MJCF, "no speed limit in the file, 1 rad/s is taken: shoulder, elbow"),
    "several trees": (
        "</worldbody>",
        '<body name="cup"><freejoint/><geom size="1"/></body></worldbody>',
        "left out: cup",
    ),
    "endless joint": ('range="-100 100" limited="true"', "", "±1000 turns: elbow"),
    "ball joint": (
        'name="elbow" axis="0 1 0" range="-100 100"',
        'name="elbow" type="ball" range="0 100"',
        "elbow (ball)",
    ),
}


@pytest.mark.parametrize("doubt", DOUBTFUL_URDF)
def test_what_is_doubtful_in_a_urdf_is_said(doubt: str, tmp_path: Path) -> None:
    old, new, note = DOUBTFUL_URDF[doubt]
    said(changed(tmp_path, URDF, old, new), note)


@pytest.mark.parametrize("doubt", DOUBTFUL_MJCF)
def test_what_is_doubtful_in_an_mjcf_is_said(doubt: str, tmp_path: Path) -> None:
    old, new, note = DOUBTFUL_MJCF[doubt]
    said(changed(tmp_path, MJCF, old, new), note)


def said(path: Path, note: str) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = load_robot(path)
    assert any(note in item for item in robot.notes), robot.notes
    assert any(issubclass(item.category, RobotWarning) and note in str(item.message) for item in caught)
    for name in ("lower", "upper", "max_velocity", "max_acceleration", "home"):
        assert np.isfinite(getattr(robot, name)).all()
    assert (robot.lower < robot.upper).all()


@pytest.mark.parametrize("text", [URDF, MJCF])
def test_a_held_joint_stays_where_it_is_put(text: str, tmp_path: Path) -> None:
    with pytest.warns(RobotWarning):
        robot = load_robot(changed(tmp_path, text, text, text), hold={"elbow": np.pi / 2})
    assert robot.joint_names == ("shoulder",)
    assert robot.held == {"elbow": (np.pi / 2, False)}
    np.testing.assert_allclose(robot.pose("tip", [0.0])[:3, 3], [0.5, 0.0, -0.25], atol=1e-15)


def test_a_tree_of_two_arms_has_a_wire_along_each(tmp_path: Path) -> None:
    arm = '<joint name="{0}" type="revolute"><parent link="base"/><child link="{0}_arm"/><axis xyz="0 0 1"/>'
    arm += '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint><link name="{0}_arm"/><link name="{0}_tip"/>'
    arm += '<joint name="{0}_end" type="fixed"><parent link="{0}_arm"/><child link="{0}_tip"/>'
    arm += '<origin xyz="0 0 {1}"/></joint>'
    path = tmp_path / "arms.urdf"
    text = f'<robot name="arms"><link name="base"/>{arm.format("left", 0.4)}{arm.format("right", 0.5)}</robot>'
    path.write_text(text, encoding="utf-8")
    with pytest.warns(RobotWarning):
        robot = load_robot(path)
    assert set(robot.wire_frames) == {
        ("universe", "left"),
        ("universe", "right"),
        ("left", "left_tip"),
        ("right", "right_tip"),
    }
    assert set(robot.tool_frames) == {"left_tip", "right_tip"}
