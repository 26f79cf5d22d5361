"""A robot whose model has no collision geometry: its wire is kept from people, and that is said once."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.danger.link_parts import LinkParts
from qpsafe.gate.gated import NO_AGES
from qpsafe.gate.pack import robot_capsules
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.trajectory import FixedPose

ARM = """<robot name="bare"><link name="base"/>{links}{joints}</robot>"""
SOLID = '<collision><geometry><box size="0.08 0.08 0.3"/></geometry></collision>'


def arm(folder: Path, kinds: str, solid: int = -1) -> qpsafe.Robot:
    """An arm of links of 0.3 m; a joint turns about y or z (``y``, ``z``) or slides along z (``s``)."""
    links, joints = "", ""
    for i, kind in enumerate(kinds, 1):
        links += f'<link name="link{i}">{SOLID if i == solid else ""}</link>'
        turns = f'<axis xyz="0 {int(kind == "y")} {int(kind != "y")}"/>'
        limit = '<limit lower="-0.1" upper="0.4" velocity="1" effort="1"/>' if kind == "s" else LIMIT
        joints += f'<joint name="j{i}" type="{"prismatic" if kind == "s" else "revolute"}">{turns}{limit}'
        joints += f'<parent link="{"base" if i == 1 else f"link{i - 1}"}"/><child link="link{i}"/>'
        joints += '<origin xyz="0 0 0.3"/></joint>'
    links += '<link name="tip"/>'
    joints += f'<joint name="end" type="fixed"><parent link="link{len(kinds)}"/><child link="tip"/>'
    joints += '<origin xyz="0.05 0 0.25"/></joint>'
    path = folder / "bare.urdf"
    path.write_text(ARM.format(links=links, joints=joints))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return qpsafe.load_robot(path)


LIMIT = '<limit lower="-2" upper="2" velocity="2" effort="1"/>'


@pytest.mark.parametrize("kinds", first(2, ["zyy", "zysy", "szy"]))
def test_the_capsules_contain_what_moves_of_the_wire(kinds: str, tmp_path: Path) -> None:
    robot = arm(tmp_path, kinds)
    capsules, parts, rng = robot_capsules(robot), LinkParts.wire(robot), np.random.default_rng(0)
    assert len(capsules.radii) > 0
    for _ in range(20):
        q = rng.uniform(robot.lower, robot.upper)
        poses, wire = robot.at(q).body_poses(), robot.wire(q, np.zeros(robot.nq))
        for name, a, b, (body, _) in zip(parts.names, wire.starts, wire.ends, parts.bodies, strict=True):
            if name not in capsules.names:
                stands = body == 0 and np.array_equal(b, robot.wire(robot.home, 0.0 * q).ends[parts.names.index(name)])
                assert stands or np.linalg.norm(b - a) < 1e-9, name
                continue
            k = capsules.names.index(name)
            T, radius = poses[capsules.bodies[k]], capsules.radii[k]
            axis = capsules.ends[k] @ T[:3, :3].T + T[:3, 3]
            along = axis[1] - axis[0]
            for point in (a, b, 0.5 * (a + b)):
                t = np.clip((point - axis[0]) @ along / (along @ along), 0.0, 1.0)
                assert np.linalg.norm(point - axis[0] - t * along) < radius + 1e-9
            if "s" not in kinds:
                np.testing.assert_allclose(np.linalg.norm(along), np.linalg.norm(b - a), atol=1e-9)
                assert radius == parts.radii[k] == 0.0


def test_only_links_without_shapes_are_their_wire(tmp_path: Path) -> None:
    robot = arm(tmp_path, "zyy", solid=2)
    capsules = robot_capsules(robot)
    assert sorted(set(capsules.bodies.tolist())) == [1, 2, 3]
    assert all((capsules.radii[k] > 0.03) == (capsules.bodies[k] == 2) for k in range(len(capsules.radii)))


def test_people_hold_it_back_and_it_is_said_once(tmp_path: Path) -> None:
    robot = arm(tmp_path, "zyy")
    tool = robot.tool_frames[0]
    controller = qpsafe.SafetyController(robot, [PositionTask(tool, FixedPose(robot.pose(tool, robot.home)))])
    told = [controller.step(robot.home, np.zeros(3), points=[]) for _ in range(3)]
    assert [any("collision geometry" in message for message in tick.messages) for tick in told] == [True, False, False]
    assert "collision geometry" in told[0].explain()
    assert told[0].status == "ok"  # the tick went as planned

    gate, qd = controller.verifies, np.array([0.0, 1.2, 0.8])
    assert gate is not None
    ahead = robot.pose(tool, robot.home)[:3, 3] + [0.1, 0.0, 0.0]
    held = gate(robot.home, qd, qd.copy(), ahead[None], NO_AGES)
    assert held.share < 0.2
    assert (held.cause, held.link.split(" to ")[1]) == ("person", tool)
    behind = ahead - [2.0, 0.0, 0.0]
    assert gate(robot.home, qd, qd.copy(), behind[None], NO_AGES).share == 1.0


def test_a_robot_with_shapes_says_nothing() -> None:
    robot = qpsafe.load_robot("irb140")
    controller = qpsafe.SafetyController(robot, [PositionTask("tcp", FixedPose(robot.pose("tcp", robot.home)))])
    assert controller.step(robot.home, np.zeros(6), points=[]).messages == ()
