"""Which joints are held and where: by robot.toml, by the caller, or because they are no joints of the arm."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.errors import RobotFileError
from qpsafe.robot.dh import dh_frames
from qpsafe.robot.joint_choice import HINGE, SLIDE, Coupling, FoundJoint, choose_joints
from qpsafe.robot.loader import load_robot
from qpsafe.robot.robot import Robot
from qpsafe.robot.robot_file.starting_file import starting_robot_toml

FILE = Path("some.urdf")
URDF = """<robot name="kit">
  <link name="base"/><link name="cart"/><link name="arm"/><link name="fore"/><link name="hand"/>
  <link name="left"/><link name="right"/><link name="wheel"/><link name="hook"/>
  <joint name="caster" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 1 0"/></joint>
  <joint name="rail" type="prismatic"><parent link="base"/><child link="cart"/><origin xyz="0 0 0.1"/>
    <axis xyz="1 0 0"/>
    <limit lower="-0.5" upper="1.5" velocity="1" effort="1"/></joint>
  <joint name="shoulder" type="revolute"><parent link="cart"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="2" effort="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="arm"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="2" effort="1"/></joint>
  <joint name="wrist" type="fixed"><parent link="fore"/><child link="hand"/><origin xyz="0.3 0 0"/></joint>
  <joint name="open" type="prismatic"><parent link="hand"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" velocity="1" effort="1"/></joint>
  <joint name="follow" type="prismatic"><parent link="hand"/><child link="right"/><axis xyz="0 1 0"/>
    <limit lower="-0.09" upper="0" velocity="1" effort="1"/><mimic joint="open" multiplier="-2" offset="-0.01"/></joint>
  <joint name="latch" type="revolute"><parent link="base"/><child link="hook"/><origin xyz="0 0.2 0"/>
    <axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
TOML = """name = "kit"
title = "Kit"
model = "kit.urdf"
home = [100.0, 0.0, 30.0]
[units]
length = "mm"
angle = "deg"
mass = "kg"
time = "s"
[joints.rail]
lower = -500.0
upper = 1500.0
max_velocity = 1000.0
max_acceleration = 2000.0
[joints.shoulder]
lower = -90.0
upper = 90.0
max_velocity = 90.0
max_acceleration = 180.0
[joints.elbow]
lower = -90.0
upper = 90.0
max_velocity = 90.0
max_acceleration = 180.0
[hold]
caster = 720.0
latch = -45.0
open = 20.0
[frames]
base = "base"
hand = "hand"
hook = "hook"
right = "right"
[wire]
links = [["base", "hand"]]
"""


def load(folder: Path, toml: str | None = TOML, **more: Any) -> Robot:
    (folder / "kit.urdf").write_text(URDF)
    if toml is not None:
        (folder / "robot.toml").write_text(toml)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(folder if toml is not None else folder / "kit.urdf", **more)


def test_a_robot_toml_holds_joints_and_states_sliding_ones_in_lengths(tmp_path: Path) -> None:
    robot = load(tmp_path)
    assert robot.joint_names == ("rail", "shoulder", "elbow")
    np.testing.assert_allclose(robot.lower, [-0.5, -np.pi / 2, -np.pi / 2])
    np.testing.assert_allclose(robot.max_acceleration, [2.0, np.pi, np.pi])
    np.testing.assert_allclose(robot.home, [0.1, 0.0, np.pi / 6])
    held = {name: joint.value for name, joint in robot.held.items()}
    assert held == pytest.approx({"caster": 4 * np.pi, "latch": -np.pi / 4, "open": 0.02, "follow": -0.05})
    q = np.array([0.3, 0.2, 0.5])
    hand = robot.pose("hand", q)
    elbow = np.array([0.3, 0.0, 0.1]) + 0.4 * np.array([np.cos(0.2), np.sin(0.2), 0.0])
    np.testing.assert_allclose(hand[:3, 3], elbow + 0.3 * np.array([np.cos(0.7), np.sin(0.7), 0.0]), atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.inv(hand) @ robot.pose("right", q) @ [0, 0, 0, 1], [0, -0.05, 0, 1], atol=1e-12
    )
    np.testing.assert_allclose(robot.pose("hook", q)[1:3, 1], np.array([1.0, -1.0]) / np.sqrt(2.0), atol=1e-12)


MISTAKES = {
    "no such joint": ("caster = 720.0", "castor = 720.0", "hold.castor", "caster, "),
    "beyond its range": ("latch = -45.0", "latch = -90.0", "hold.latch", "-57.29"),
    "no number": ("latch = -45.0", "latch = true", "hold.latch", "number"),
    "held and moved": ("[hold]", "[hold]\nelbow = 0.0", "hold.elbow", "[joints.elbow]"),
    "neither": ("latch = -45.0\n", "", "joints.latch", "missing"),
    "limits of what follows": ("[hold]", "[joints.follow]\nLIMITS\n[hold]", "joints.follow", "not held"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_hold_is_named(mistake: str, tmp_path: Path) -> None:
    old, new, key, expected = MISTAKES[mistake]
    limits = "lower = -80.0\nupper = 0.0\nmax_velocity = 1.0\nmax_acceleration = 1.0"
    text = TOML.replace(old, new.replace("LIMITS", limits))
    if "follow" in new:
        text = text.replace("30.0]", "30.0, 0.0]")
    with pytest.raises(RobotFileError) as caught:
        load(tmp_path, text)
    assert caught.value.key == key
    assert expected in caught.value.expected


def test_a_bare_file_holds_its_gripper_and_what_the_caller_holds(tmp_path: Path) -> None:
    robot = load(tmp_path, None)
    assert set(robot.joint_names) == {"caster", "rail", "shoulder", "elbow", "latch"}
    assert {name: joint.value for name, joint in robot.held.items()} == {"open": 0.0, "follow": -0.01}
    assert any("gripper" in note and "open, follow" in note for note in robot.notes)
    robot = load(tmp_path, None, hold={"caster": 0.5, "latch": 0.1, "open": 0.04})
    assert set(robot.joint_names) == {"rail", "shoulder", "elbow"}
    assert robot.held["follow"].value == pytest.approx(-0.09)
    assert not any("gripper" in note and "open" in note for note in robot.notes)


def test_a_starting_file_says_what_is_held(tmp_path: Path) -> None:
    bare = load(tmp_path, None, hold={"caster": 0.5, "open": 0.03})
    again = load(tmp_path, starting_robot_toml(bare, tmp_path))
    assert again.joint_names == bare.joint_names
    assert {name: joint.value for name, joint in again.held.items()} == pytest.approx(
        {name: joint.value for name, joint in bare.held.items()}, abs=1e-7
    )
    for key in ("lower", "upper", "max_velocity", "max_acceleration", "home"):
        np.testing.assert_allclose(getattr(again, key), getattr(bare, key), rtol=0, atol=1e-7)


def chain(*kinds: str) -> list[FoundJoint]:
    """Joints j0, j1 ... one on another."""
    parents = [None, *(f"j{i}" for i in range(len(kinds)))]
    return [FoundJoint(f"j{i}", kind, parents[i], f"b{i}", -2.0, 2.0) for i, kind in enumerate(kinds)]


@given(
    st.lists(st.sampled_from([HINGE, SLIDE, "ball"]), min_size=2, max_size=7),
    st.integers(0, 6),
    st.integers(0, 6),
    st.floats(-2, 2),
    st.floats(-1, 1),
)
def test_in_a_chain_what_follows_is_refused_until_its_source_is_held(
    kinds: list[str], source: int, follower: int, factor: float, value: float
) -> None:
    joints = chain(HINGE, *kinds, HINGE)
    source, follower = source % len(joints), follower % len(joints)
    if source == follower or "ball" in (joints[source].kind, joints[follower].kind):
        return
    coupling = Coupling(f"j{source}", (0.1, factor, 0.2), 0.3, -0.4)
    joints[follower] = joints[follower]._replace(follows=coupling)
    with pytest.raises(RobotFileError, match=f"joint j{follower} = 'moves with j{source}'"):
        choose_joints(FILE, joints, {})
    moving = [j for j in joints if j.kind != "ball"]
    if len(moving) > 2:
        held = choose_joints(FILE, joints, {f"j{source}": value}).held
        moved = value + 0.4
        assert held == pytest.approx(
            {f"j{source}": value, f"j{follower}": 0.3 + 0.1 + factor * moved + 0.2 * moved**2}, abs=1e-12
        )


def test_fingers_are_sliding_ends_side_by_side() -> None:
    arm = [*chain(HINGE, HINGE), *(FoundJoint(f"f{i}", SLIDE, "j1", "hand", 0.0, 1.0, rest=0.2) for i in range(3))]
    choice = choose_joints(FILE, arm, {})
    assert choice.held == {"f0": 0.2, "f1": 0.2, "f2": 0.2}
    assert choose_joints(FILE, arm, {}, wanted={"f0", "f1"}).held == {"f2": 0.2}
    assert choose_joints(FILE, arm[:3], {}).held == {}  # a single one is a SCARA's
    assert choose_joints(FILE, arm, {"f0": 0.5, "f1": 0.5}).held == {"f0": 0.5, "f1": 0.5}


def test_a_denavit_hartenberg_table_with_a_joint_that_slides() -> None:
    table = np.array([[0.1, 0.2, 0.3, 0.4], [0.0, 0.1, 0.0, 0.0]])
    frames = dh_frames(table, np.array([0.5, 0.7]), np.array([False, True]))
    np.testing.assert_allclose(
        frames, dh_frames(table + np.array([[0, 0, 0, 0], [0, 0.7, 0, 0]]), np.array([0.5, 0.0]))
    )


NO_NUMBERS = ["0.1", "", None, True, [0.1], {}, 1j, np.nan, np.inf, -np.inf, np.array([0.1])]


@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
def test_what_is_held_at_no_number_is_named(value: object, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError) as caught:
        load(tmp_path, None, hold={"latch": value})
    assert caught.value.key == "hold.latch"
    assert "finite number" in caught.value.expected


@pytest.mark.parametrize("hold", ["latch", "", ["latch"], [], [("latch", 0.1)], 0.1, 0, True, False], ids=repr)
def test_what_is_no_mapping_holds_nothing(hold: object, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError) as caught:
        load(tmp_path, None, hold=hold)
    assert (caught.value.key, caught.value.value) == ("hold", hold)


@pytest.mark.parametrize("value", [0, 0.1, np.float64(0.1), np.float32(0.1), np.int64(1)], ids=repr)
def test_any_real_number_holds_a_joint(value: float, tmp_path: Path) -> None:
    assert load(tmp_path, None, hold={"latch": value}).held["latch"].value == pytest.approx(float(value))
