"""The home posture of any number of arms is what the page promises, or what it is not is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from amounts import some
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qpsafe.robot.loader import load_quietly
from qpsafe.robot.robot import Robot
from qpsafe.sim.experiments.shared.home import Arm, Touching, chosen_home, quality
from qpsafe.sim.experiments.shared.ready import choices
from qpsafe.sim.world.tool_axis import tool_axis

pytestmark = pytest.mark.long

#: Axis, range [rad] and length of the link [m] of six joints.
AXES = (
    ("0 0 1", -3.1, 3.1, 0.1), ("0 1 0", -1.6, 2.2, 0.42), ("0 1 0", -0.4, 2.7, 0.34), ("0 0 1", -3.1, 3.1, 0.09),
    ("0 1 0", -2.1, 2.1, 0.05), ("0 0 1", -3.1, 3.1, 0.08),
)  # fmt: skip


def link(name: str, length: float, shape: bool = True) -> str:
    middle = f'<origin xyz="0 0 {length / 2}"/>'
    solid = f'<collision>{middle}<geometry><cylinder radius="0.045" length="{0.8 * length}"/></geometry></collision>'
    mass = f'<inertial>{middle}<mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}">{mass}</inertial>{solid * shape}</link>'


def joint(name: str, parent: str, child: str, at: str, axis: str, low: float, high: float) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
        f'<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" velocity="3" effort="200"/></joint>'
    )


def write_arms(folder: Path, places: list[float], joints: list[int], torso: bool) -> Path:
    """Arms on a table or on a torso that turns, at some places across, of some joints each."""
    text, root = link("table", 0.3), "table"
    if torso:
        text += link("torso_l", 0.05, False) + joint("torso", "table", "torso_l", "0 0 0", "0 0 1", -1.5, 1.5)
        root = "torso_l"
    for k, (y, count) in enumerate(zip(places, joints, strict=True)):
        parent, at = root, f"0 {y} 0.3"
        for j, (axis, low, high, length) in enumerate(AXES[:count]):
            name = f"a{k}_{j}"
            text += link(f"{name}_l", length) + joint(name, parent, f"{name}_l", at, axis, low, high)
            parent, at = f"{name}_l", f"0 0 {length}"
        text += f'<link name="tool{k}"/><joint name="tip{k}" type="fixed"><parent link="{parent}"/>'
        text += f'<child link="tool{k}"/><origin xyz="0 0 {AXES[count - 1][3] + 0.07}"/></joint>'
    path = folder / "arms.urdf"
    path.write_text(f'<robot name="arms">{text}</robot>', encoding="utf-8")
    return path


def check(robot: Robot, q: np.ndarray, missed: tuple[str, ...]) -> None:
    """What is not said is so."""
    said = "; ".join(missed)
    for tool in robot.tool_frames:
        arm, pose = Arm.of(robot, tool, q), robot.pose(tool, q)
        if f"{tool} looks" not in said:
            np.testing.assert_allclose(pose[:3, :3] @ tool_axis(robot, tool), [0.0, 0.0, -1.0], atol=0.09)
        if f"{tool} is" not in said:
            assert pose[0, 3] - arm.shoulder[0] > 0.2 * arm.length
        if f"{tool} is near" not in said and "near a limit" not in said:
            assert quality(robot, arm, q) > 0.01
    assert ("links touch" in said) is (Touching(robot)(q) > 0)


@settings(max_examples=some(2, of=12), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.sampled_from([-0.6, -0.35, 0.35, 0.6]), min_size=1, max_size=3, unique=True),
    st.lists(st.sampled_from([3, 4, 6, 6]), min_size=3, max_size=3),
    st.booleans(),
)
def test_every_arm_gets_a_home_and_what_is_missed_is_said(
    tmp_path: Path, places: list[float], joints: list[int], torso: bool
) -> None:
    robot = load_quietly(write_arms(tmp_path, places, joints[: len(places)], torso))
    q, missed = chosen_home(robot)
    assert ((robot.lower <= q) & (q <= robot.upper)).all()
    check(robot, q, missed)
    for k, count in enumerate(joints[: len(places)]):  # six joints can do all that is promised
        assert count < 6 or not any(f"tool{k}" in item for item in missed), missed


def test_two_arms_side_by_side_have_the_same_home(tmp_path: Path) -> None:
    robot = load_quietly(write_arms(tmp_path, [0.6, -0.6], [6, 6], False))
    found = choices(robot, sensors=False)
    assert not any("not as it should be" in item for item in found.said)
    assert quality(robot, Arm.of(robot, "tool1"), found.robot.home) > 0.1


def test_what_is_missed_is_written_down(tmp_path: Path) -> None:
    """Three joints hold no tool any way round."""
    found = choices(load_quietly(write_arms(tmp_path, [0.0], [3], False)), sensors=False)
    assert any("of the home posture, not as it should be: tool0 looks" in item for item in found.said), found.said
    assert "tool0 looks" in found.robot_toml(tmp_path)
