"""A robot is the same robot wherever it stands: its wire, the danger around it, and its thresholds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.field import DangerField
from qpsafe.danger.thresholds import REFERENCE_DISTANCE, reference_field
from qpsafe.robot.loader import load_quietly

SEEDS, ANGLES = st.integers(0, 2**32 - 1), st.floats(-3.1, 3.1)
PLACES = st.tuples(*[st.sampled_from([0.0, 0.4, -1.1, 5.0, 30.0]) | st.floats(-30.0, 30.0)] * 3)
FORMATS = st.sampled_from(["urdf", "mjcf"])


def pose(xyz: Any, rpy: tuple[float, float, float]) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pin.rpy.rpyToMatrix(*rpy), xyz
    return matrix


@pytest.fixture(scope="module")
def pair(arm_writer: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A robot at the origin and the same one somewhere else."""
    folder: Path = tmp_path_factory.mktemp("moved")

    def made(seed: int, arms: int, kind: str, stand: np.ndarray) -> list[qpsafe.Robot]:
        write = getattr(arm_writer(seed, arms), kind)
        return [load_quietly(write(folder / f"arms.{kind}", at)) for at in (np.eye(4), stand)]

    return made


@settings(max_examples=some(15, 150))
@given(SEEDS, st.integers(1, 2), FORMATS, PLACES, st.tuples(ANGLES, ANGLES, ANGLES))
def test_the_wire_and_its_danger_move_with_the_base(
    pair: Any, seed: int, arms: int, kind: str, xyz: tuple[float, ...], rpy: tuple[float, float, float]
) -> None:
    stand, rng = pose(xyz, rpy), np.random.default_rng(seed)
    robot, moved = pair(seed, arms, kind, stand)
    q, qd = rng.uniform(-2.0, 2.0, robot.nq), rng.uniform(-1.0, 1.0, robot.nq)
    here, there = robot.wire(q, qd), moved.wire(q, qd)
    for k, (one, other) in enumerate(zip(here, there, strict=True)):
        shift = stand[:3, 3] if k < 2 else 0.0  # places, velocities
        np.testing.assert_allclose(
            other, one @ stand[:3, :3].T + shift, rtol=0.0, atol=1e-12 * max(1.0, *map(abs, xyz))
        )
    points = here.ends[-1] + rng.uniform(0.1, 1.0, (20, 3)) * rng.choice([-1.0, 1.0], (20, 3))
    field = DangerField()
    expected = field.value(points, here)
    np.testing.assert_allclose(field.value(points @ stand[:3, :3].T + stand[:3, 3], there), expected, rtol=1e-9)


@settings(max_examples=some(15, 150))
@given(SEEDS, st.integers(1, 2), FORMATS, PLACES, ANGLES)
def test_thresholds_are_the_same_wherever_the_robot_stands(
    pair: Any, seed: int, arms: int, kind: str, xyz: tuple[float, float, float], yaw: float
) -> None:
    """And they come from a point that is clear of it, beside a second arm too."""
    robot, moved = pair(seed, arms, kind, pose(xyz, (0.0, 0.0, yaw)))
    field = reference_field(robot)
    assert reference_field(moved) == pytest.approx(field, rel=1e-9)
    assert field <= len(robot.wire_frames) / REFERENCE_DISTANCE * (1.0 + 1e-5)


def test_a_robot_that_faces_the_origin_evades_as_any_other(pair: Any) -> None:
    """It did not: with the point for its thresholds inside itself nothing was danger enough."""
    stand, left = pose((5.0, 0.0, 0.0), (0.0, 0.0, np.pi)), []
    for robot, there in zip(pair(3, 1, "urdf", stand), (np.eye(4), stand), strict=True):
        tip = robot.pose(robot.tool_frames[0], robot.home)
        tasks = [qpsafe.PositionTask(robot.tool_frames[0], qpsafe.FixedPose(tip))]
        controller, q, qd = qpsafe.SafetyController(robot, tasks, gate="off"), robot.home, np.zeros(robot.nq)
        for _ in range(150):
            tick = controller.step(q, qd, points=[tip[:3, 3] + there[:3, :3] @ [0.1, 0.0, 0.05]])
            q, qd = tick.reference.q, tick.reference.qd
        left.append(q - robot.home)
    assert np.abs(left[0]).max() > 0.1
    np.testing.assert_allclose(left[1], left[0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("far", [0.9, 5.0])
def test_a_first_joint_on_the_world_itself_is_reported_where_it_is_far(far: float, tmp_path: Path) -> None:
    """MJCF and URDF have no frame there where the wire could begin."""
    body = (
        f'<body name="b" pos="{far} 0 0"><joint name="j" range="-1 1"/><geom size="0.1"/><site name="t" pos="1 0 0"/>'
    )
    (tmp_path / "arm.xml").write_text(
        f'<mujoco><compiler angle="radian"/><worldbody>{body}</body></worldbody></mujoco>'
    )
    joint = f'<joint name="j" type="revolute"><parent link="world"/><child link="b"/><origin xyz="{far} 0 0"/>'
    joint += '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
    (tmp_path / "arm.urdf").write_text(f'<robot name="r"><link name="world"/><link name="b"/>{joint}</robot>')
    for name in ("arm.xml", "arm.urdf"):
        said = [note for note in load_quietly(tmp_path / name).notes if "world's origin" in note]
        assert len(said) == (far > 1.0)
