"""Limits of a user's: those that give way are told, those that nothing was reckoned for are refused or told."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.gate.gated import TOO_LONG
from qpsafe.sensing.hulls import Obstacle
from qpsafe.tasks.joint import PostureTask

ROBOT = qpsafe.load_robot("irb140")
TIP = ROBOT.pose("tcp", ROBOT.home)


def own(**changes: Any) -> qpsafe.JointLimits:
    given = {"lower": ROBOT.lower, "upper": ROBOT.upper, "max_velocity": ROBOT.max_velocity}
    return qpsafe.JointLimits(**{**given, "max_acceleration": ROBOT.max_acceleration, **changes})


def tasks(ahead: float = 0.0) -> list[Any]:
    goal = TIP.copy()
    goal[0, 3] += ahead
    return [qpsafe.PositionTask("tcp", qpsafe.FixedPose(goal), gain=4.0)]


@settings(max_examples=some(3, of=30), deadline=None)
@given(seed=st.integers(0, 2**32 - 1), jerk=st.sampled_from([5.0, 20.0, 100.0]))
def test_whoever_leaves_the_box_says_which_jerk_limit_gave_way(run: Any, seed: int, jerk: float) -> None:
    """A gate that brakes, a bad tick, a robot held: after every stage, not only after the law."""
    rng = np.random.default_rng(seed)
    wall = Obstacle.box("wall", (0.1, 1.0, 1.0), TIP[:3, 3] + (rng.uniform(0.1, 0.2), 0.0, 0.0))
    limits, left = own(max_jerk=jerk * ROBOT.max_acceleration), 0
    loop = run(tasks=tasks(0.3), known=[wall], clearance="off", limits=limits)
    for k in range(150):
        point = TIP[:3, 3] + rng.normal(0.0, 0.4, 3)
        tick = loop.feed(None if k % 40 == 30 else loop.q, loop.qd, points=[point] if k % 50 > 40 else [])
        box, qd = tick.box, tick.reference.qd
        beyond = np.maximum(box.lower - qd, qd - box.upper) > 1e-9
        left += bool(beyond.any())
        for j in np.flatnonzero(beyond):
            assert box.sacrificed[j] > 0
            assert any(ROBOT.joint_names[j] in message and "sacrificed" in message for message in tick.messages)
            assert tick.status != "ok"
    assert left > 0 or jerk > 50.0


@pytest.mark.parametrize("share", [1e-2, 1e-3, 1e-5])
def test_minutes_of_braking_are_not_looked_at_in_one_tick(share: float) -> None:
    """However long braking takes, a tick looks at no more than so many instants of it; then it brakes, and says so."""
    wall = Obstacle.box("wall", (0.1, 2.0, 2.0), TIP[:3, 3] + (0.5, 0.0, 0.0))
    controller = qpsafe.SafetyController(ROBOT, tasks(0.3), known=[wall])
    q, qd = ROBOT.home.copy(), np.zeros(6)
    for _ in range(40):
        tick = controller.step(q, qd, points=[])
        q, qd = tick.reference.q, tick.reference.qd
    assert np.abs(qd).max() > 0.1
    least = share * ROBOT.max_acceleration
    controller.limits = own(max_acceleration=least)
    for _ in range(3):
        before = qd
        tick = controller.step(q, qd, points=[TIP[:3, 3] + (0.3, 0.0, 0.0)])
        q, qd = tick.reference.q, tick.reference.qd
        assert (np.abs(qd - before) <= least * 0.004 + 1e-9).all()
        if tick.gate.short == np.inf:
            assert TOO_LONG in tick.messages
            assert (tick.status, tick.gate.verified) == ("degraded", False)
            np.testing.assert_allclose(qd, before - np.clip(before, -least * 0.004, least * 0.004), atol=1e-12)
    assert tick.gate.short == np.inf or share > 1e-5


@settings(max_examples=some(6, of=60), deadline=None)
@given(
    joint=st.integers(0, 5), by=st.floats(1e-6, 400.0), side=st.sampled_from(["lower", "upper"]),
    copied=st.sampled_from([copy.deepcopy, copy.copy, lambda whole: pickle.loads(pickle.dumps(whole))]),
)  # fmt: skip
def test_limits_that_turn_beyond_the_robots_own_are_told_once(joint: int, by: float, side: str, copied: Any) -> None:
    """In degrees, for instance; copies do not say it again."""
    wide = getattr(ROBOT, side).copy()
    wide[joint] += by if side == "upper" else -by
    controller = qpsafe.SafetyController(ROBOT, tasks(), limits=own(**{side: wide}))
    said = [controller.step(ROBOT.home, np.zeros(6), points=[]).messages for _ in range(2)]
    assert sum("beyond the robot's own" in message for message in said[0]) == 1
    assert any(f"of {ROBOT.joint_names[joint]}:" in message for message in said[0])
    assert said[1] == ()
    assert copied(controller).step(ROBOT.home, np.zeros(6), points=[]).messages == ()
    controller.limits = own()
    assert controller.step(ROBOT.home, np.zeros(6), points=[]).messages == ()


SLIDE = """<robot name="p"><link name="w"/><link name="a"/>
<link name="b"><collision><geometry><box size=".1 .1 .1"/></geometry></collision></link><link name="tip"/>
<joint name="j1" type="revolute"><parent link="w"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="2" effort="1"/></joint>
<joint name="j2" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>
<limit lower="{lower}" upper="{upper}" velocity="1" effort="1"/></joint>
<joint name="t" type="fixed"><parent link="b"/><child link="tip"/><origin xyz=".05 0 0"/></joint></robot>"""


@pytest.mark.parametrize("beyond", [0.09, -0.09, 0.0])
def test_no_wall_is_touched_from_wherever_a_joint_that_slides_is_believed_to_be(tmp_path: Path, beyond: float) -> None:
    """Levers are reckoned for its own range and the little beyond that still counts as a measurement; no farther."""
    path = tmp_path / "p.urdf"
    path.write_text(SLIDE.format(lower=0.1, upper=0.5), encoding="utf-8")
    robot = qpsafe.load_robot(path)
    limits = qpsafe.JointLimits([-3.0, 0.1], [3.0, 0.5], robot.max_velocity, [3.0, 4.0])
    out = 0.5 + beyond if beyond >= 0.0 else 0.1 + beyond
    place = np.array([max(out, 0.2) * np.cos(1.0), max(out, 0.2) * np.sin(1.0), 0.0])
    wall = Obstacle.box("wall", (0.05, 0.05, 0.5), place)
    task = PostureTask(np.array([2.0, out]), gain=20.0)
    for clearance in (None, "off"):
        controller = qpsafe.SafetyController(robot, [task], limits=limits, known=[wall], clearance=clearance)
        q, qd, least = np.array([0.0, out]), np.zeros(2), np.inf
        for _ in range(500):
            tick = controller.step(q, qd, points=[])
            q, qd = tick.reference.q, tick.reference.qd
            pose = robot.at(q).body_poses()[2]
            corners = np.array([(x, y, 1.0) for x in np.linspace(-0.05, 0.05, 9) for y in np.linspace(-0.05, 0.05, 9)])
            at = corners @ np.column_stack((pose[:2, :2], pose[:2, 3])).T
            least = min(least, float(np.linalg.norm(np.maximum(np.abs(at - place[:2]) - 0.025, 0.0), axis=1).min()))
        assert least > 1e-3
    for key, value in (("upper", [3.0, 0.51]), ("lower", [-3.0, 0.0])):
        given = {"lower": [-3.0, 0.1], "upper": [3.0, 0.5]} | {key: value}
        wide = qpsafe.JointLimits(**given, max_velocity=robot.max_velocity, max_acceleration=[3.0, 4.0])
        with pytest.raises(ConfigurationError, match=rf"limits\.{key}.* m of j2"):
            qpsafe.SafetyController(robot, [task], limits=wide)
    tick = qpsafe.SafetyController(robot, [task]).step([0.0, 2.4], [0.0, 0.0], points=[])
    assert tick.status == "bad_input"
    assert "j2" in tick.messages[0]
