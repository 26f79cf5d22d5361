"""A hundred URDFs that mix what the format can say equal pinocchio's untouched reading, or are refused by name."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from amounts import first

from qpsafe.errors import RobotFileError
from qpsafe.robot.loader import load_robot
from qpsafe.robot.robot import Robot
from qpsafe.robot.robot_file.starting_file import starting_robot_toml
from qpsafe.sensing.body import body_hulls

SEEDS = 100
TURN = 2.0 * np.pi


def load(path: Path, **more: Any) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(path, **more)


@pytest.mark.parametrize("start", first(1, range(0, SEEDS, 20)))
def test_a_mixed_urdf_is_what_pinocchio_reads_or_is_refused(start: int, tmp_path: Path, urdf_writer: Any) -> None:
    loaded = refused = 0
    for seed in range(start, start + 20):
        folder = tmp_path / f"mix{seed}"
        folder.mkdir()
        writer = urdf_writer(folder, seed)
        path = writer.write()
        if writer.mimic is not None:
            with pytest.raises(RobotFileError) as caught:
                load(path)
            assert caught.value.key == f"joint {writer.mimic}"
            held = {"axis0": 0.3, "level": -0.3}  # as the error says: hold both
            compare(path, load(path, hold=held), held, writer.boxes)
            refused += 1
        else:
            compare(path, load(path), writer.held, writer.boxes)
            loaded += 1
    assert loaded >= 10
    assert refused >= 1


def compare(path: Path, robot: Robot, held: dict[str, float], boxes: dict[str, list[np.ndarray]]) -> None:
    """Links, limits, mass matrix and collision shapes."""
    model = pin.buildModelFromUrdf(str(path))
    assert {name: joint.value for name, joint in robot.held.items()} == pytest.approx(held, abs=1e-12)
    assert set(robot.joint_names) | set(held) == set(list(model.names)[1:])
    data, rng, worst = model.createData(), np.random.default_rng(0), 0.0
    moving = [model.joints[model.getJointId(name)] for name in robot.joint_names]
    endless = np.array([joint.nq == 2 for joint in moving])
    np.testing.assert_array_equal(robot.endless, endless)
    for i, joint in enumerate(moving):
        if not endless[i]:
            assert robot.lower[i] == model.lowerPositionLimit[joint.idx_q]
            assert robot.upper[i] == model.upperPositionLimit[joint.idx_q]
    for q in (robot.home, *rng.uniform(np.maximum(robot.lower, -TURN), np.minimum(robot.upper, TURN), (4, robot.nq))):
        full = pin.neutral(model)
        for name, value in (*held.items(), *zip(robot.joint_names, q, strict=True)):
            joint = model.joints[model.getJointId(name)]
            full[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        pin.framesForwardKinematics(model, data, full)
        state = robot.at(q)
        for i, frame in enumerate(model.frames):
            if frame.type == pin.FrameType.BODY:
                worst = max(worst, np.abs(state.pose(frame.name) - data.oMf[i].homogeneous).max())
        for name in robot.joint_names:
            frame = f"{name} (joint)" if f"{name} (joint)" in robot.frame_names else name
            worst = max(worst, np.abs(state.pose(frame) - data.oMi[model.getJointId(name)].homogeneous)[:3, 3].max())
        upper, work = np.triu(pin.crba(model, data, full)), robot.model.createData()
        theirs, own = upper + np.triu(upper, 1).T, np.triu(pin.crba(robot.model, work, q))
        dofs = [joint.idx_v for joint in moving]
        worst = max(worst, np.abs(own + np.triu(own, 1).T - theirs[np.ix_(dofs, dofs)]).max())
    assert worst <= 1e-9
    compare_hulls(robot, boxes)


def compare_hulls(robot: Robot, boxes: dict[str, list[np.ndarray]]) -> None:
    """Each collision shape has a hull of its extents in its link's frame; balls are a little larger."""
    hulls = [(joint, vertices) for joint, _, vertices in body_hulls(robot)]
    assert len(hulls) == sum(map(len, boxes.values()))
    for link, expected in boxes.items():
        joint, placement = robot.mounting(link)
        for box in expected:
            for k, (body, vertices) in enumerate(hulls):
                local = (vertices - placement[:3, 3]) @ placement[:3, :3]
                found = np.array([local.min(axis=0), local.max(axis=0)])
                size = np.abs(box[1] - box[0]).max()
                if body == joint and np.abs(found - box).max() <= (1e-7 if len(vertices) <= 12 else 0.02 * size):
                    del hulls[k]
                    break
            else:
                raise AssertionError(f"no hull where {link} has a shape")


@pytest.mark.parametrize("seed", [2, 5, 17, 31])  # 17: the wire ends at a joint that slides
def test_a_starting_file_is_the_same_robot(seed: int, tmp_path: Path, urdf_writer: Any) -> None:
    writer = urdf_writer(tmp_path, seed)
    robot = load(writer.write(), hold=None if writer.mimic is None else {"axis0": 0.3, "level": -0.3})
    (tmp_path / "robot.toml").write_text(starting_robot_toml(robot, tmp_path))
    again = load(tmp_path)
    assert (again.joint_names, again.frame_names) == (robot.joint_names, robot.frame_names)
    assert again.wire_frames == robot.wire_frames
    q = np.clip(np.random.default_rng(seed).uniform(-2.0, 2.0, robot.nq), robot.lower, robot.upper)
    for frame in robot.frame_names:
        np.testing.assert_allclose(again.pose(frame, q), robot.pose(frame, q), rtol=0, atol=1e-7)
    for key in ("lower", "upper", "max_velocity", "max_acceleration", "home"):
        np.testing.assert_allclose(getattr(again, key), getattr(robot, key), rtol=0, atol=1e-7)


WORDS = (
    "nan",
    "inf",
    "",
    "x",
    "-1",
    "0",
    "0 0 0",
    "1e400",
    "${a}",
    "base",
    "axis1",
    "1 2",
    "fixed",
    "floating",
    "planar",
)


@pytest.mark.parametrize("start", first(1, range(0, 60, 20)))
def test_a_broken_urdf_loads_or_is_refused_by_name(start: int, tmp_path: Path, urdf_writer: Any) -> None:
    """Attributes and elements taken away, doubled or exchanged: no other error, nothing that is not finite."""
    for seed in range(start, start + 20):
        folder, rng = tmp_path / f"broken{seed}", np.random.default_rng(seed)
        folder.mkdir()
        path = urdf_writer(folder, seed).write()
        text = path.read_text()
        for _ in range(rng.integers(1, 4)):
            attributes = list(re.finditer(r' \w+="([^"]*)"', text))
            found = attributes[rng.integers(len(attributes))]
            word = WORDS[rng.integers(len(WORDS))]
            changes = [("", found.span()), (word, found.span(1))]
            elements = list(re.finditer(r"<\w+[^<>]*/>", text))
            if elements:
                element = elements[rng.integers(len(elements))]
                changes += [("", element.span()), (2 * element.group(), element.span())]
            new, (start, stop) = changes[rng.integers(len(changes))]
            text = text[:start] + new + text[stop:]
        path.write_text(text)
        try:
            robot = load(path)
            hulls = body_hulls(robot)
        except RobotFileError as error:
            assert "pinocchio can read" not in error.expected, error  # noqa: PT017  # that names no element
        else:
            for key in ("lower", "upper", "max_velocity", "max_acceleration", "home"):
                assert np.isfinite(getattr(robot, key)).all()
            assert all(np.isfinite(vertices).all() for _, _, vertices in hulls)
