"""A batch of robots in different situations against as many controllers, tick by tick."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sensing.hulls import Obstacle
from qpsafe.tasks.moves import Dwell, Line
from qpsafe.tasks.program import Program
from qpsafe.tasks.rotation import exp3
from qpsafe.tasks.trajectory import Sample

pytestmark = pytest.mark.long


def fixed_tasks(robot: Any, count: int = 2) -> list[Any]:
    """Position, then orientation, of every tool."""
    goals = {frame: qpsafe.FixedPose(robot.pose(frame, robot.home)) for frame in robot.tool_frames}
    kinds = (qpsafe.PositionTask, qpsafe.OrientationTask)[:count]
    return [kind(frame, goal) for kind in kinds for frame, goal in goals.items()]


def shifted(pose: np.ndarray, shift: Any, turn: Any = (0.0, 0.0, 0.0)) -> np.ndarray:
    moved = pose.copy()
    moved[:3, 3] += shift
    moved[:3, :3] = exp3(np.array(turn)) @ pose[:3, :3]
    return moved


def program(robot: Any, cycle: bool) -> Program:
    a = robot.pose("tcp", robot.home)
    b = shifted(a, (0.0, 0.08, -0.05), (0.1, 0.0, 0.3))
    c = shifted(a, (-0.04, -0.05, 0.02), (0.0, -0.2, 0.0))
    return Program([Line(a, b), Dwell(b, 0.1), Line(b, c), Line(c, a)], [(1, "grip"), (2, "go"), (3, "drop")], cycle)


@pytest.mark.parametrize(("name", "count"), first(1, [("irb140", 2), ("irb14000", 2), ("irb140", 1), ("iiwa14", 2)]))
def test_fixed_poses_give_the_same_bits(pairs: Any, come: Any, name: str, count: int) -> None:
    """Robots of 6, 7 and 14 joints; a few are told what is no point, or no measurement, now and then."""
    robot = qpsafe.load_robot(name)
    tasks, tools = fixed_tasks(robot, count), len(robot.tool_frames)
    activation = qpsafe.robot_activation(robot, tools, tools) if tools > 1 else None
    loop = pairs(lambda: qpsafe.SafetyController(robot, tasks, activation=activation), 6)
    ticks = some(300, of=450)
    points = come(robot, 6, ticks)
    for k in range(ticks):
        for r in (2, 4):
            if (k + 7 * r) % 97 == 0:
                points[r][k] = np.full((2, 3), np.nan)
        wrong = {1: np.full(robot.nq, np.nan)} if k % 83 == 0 else {3: np.full(robot.nq, 1e9)} if k % 89 == 0 else {}
        loop.step(lambda r, k=k: {"points": points[r][k]}, wrong)
    assert set(loop.phases) == {"following", "suspended", "recovering"}
    assert loop.statuses["bad_input"] > 10


@pytest.mark.slow
@pytest.mark.parametrize("cycle", first(1, [True, False]))
def test_programs_wait_at_their_events_and_tell_each_once(pairs: Any, come: Any, irb140: Any, cycle: bool) -> None:
    path = program(irb140, cycle)
    tasks = [qpsafe.PositionTask("tcp", path), qpsafe.OrientationTask("tcp", path)]
    loop = pairs(lambda: qpsafe.SafetyController(irb140, tasks), 5, 1e-9)
    points = come(irb140, 5, 1100, seed=3)
    for k in range(1100):
        loop.step(lambda r, k=k: {"points": points[r][k if r else 0][: r % 4]})
    assert len(loop.events) > 8
    assert set(loop.phases) == {"following", "suspended", "recovering"}


class Circle:
    """A path of somebody's own, which tells no end; with an event every second."""

    def __init__(self, pose: np.ndarray) -> None:
        self.pose = pose

    def sample(self, t: float) -> Sample:
        turn = np.array((np.sin(2.0 * t), 1.0 - np.cos(2.0 * t), 0.0))
        rate = 0.1 * np.array((np.cos(2.0 * t), np.sin(2.0 * t), 0.0))
        return Sample(shifted(self.pose, 0.05 * turn), np.concatenate((rate, np.zeros(3))))

    def event(self, k: int) -> Any:
        return qpsafe.tasks.program.Event(k + 0.5, f"lap {k}")


@pytest.mark.slow
def test_paths_that_tell_no_end_are_looked_at_as_far_as_need_be(pairs: Any, come: Any, irb140: Any) -> None:
    path = Circle(irb140.pose("tcp", irb140.home))
    tasks = [qpsafe.FrameTask("tcp", path, 10.0, rows=(0, 1, 2, 5))]
    loop = pairs(lambda: qpsafe.SafetyController(irb140, tasks), 4, 1e-9, horizon=0.4)
    points = come(irb140, 4, 700, seed=5)
    for k in range(700):
        loop.step(lambda r, k=k: {"points": points[r][k if r else 0]})
    assert {name for _, name in loop.events} >= {"lap 0", "lap 1"}


def test_sick_sensors_are_the_robots_own(pairs: Any, irb140: Any) -> None:
    """Silent, stuck, stale, negative, in centimetres, acknowledged: each robot as if it were alone."""
    soon = qpsafe.RecoveryRules.paper()  # on the way back
    loop = pairs(lambda: qpsafe.SafetyController(irb140, fixed_tasks(irb140), recovery=soon), 8)
    rng, k_spots, told = np.random.default_rng(2), len(loop.controllers[0].spots), [set() for _ in range(8)]
    for k in range(460):
        base = 0.55 + 0.3 * np.cos(0.02 * k + np.arange(8))[:, None] + rng.normal(0.0, 2e-3, (8, k_spots))
        ages = np.full((8, k_spots), 0.004)
        distances = np.where(base > 0.78, np.inf, base)
        distances[1, 3] = np.nan if 60 < k < 120 else distances[1, 3]
        distances[2, :8] = np.nan if 130 < k < 160 else distances[2, :8]
        distances[3] = 0.5 if 160 < k < 230 else distances[3]
        ages[4, ::4] = 0.5 if 200 < k < 203 else 0.0
        distances[5, 2] = -1.0 if k > 220 else distances[5, 2]
        distances[6, 7] = 42.0
        if k == 320:
            loop.batch.acknowledge()
            for controller in loop.controllers:
                controller.acknowledge()
        if k == 400:
            loop.batch.reseed(np.arange(8) % 2 == 0)
            for controller in loop.controllers[::2]:
                controller.reseed()
        tick = loop.step(lambda r, d=distances, a=ages: {"distances": d[r], "ages": a[r]})
        for r in range(8):
            told[r] |= set(tick.words(r))
    assert set(loop.statuses) == {"ok", "degraded", "bad_input"}
    assert set(loop.phases) == {"following", "suspended", "recovering"}
    expected = ("", "not a number", "out of order", "stuck", "stale", "below zero", "metres", "")
    for words, part in zip(told, expected, strict=True):
        assert any(part in sentence for sentence in words) if part else not words


@pytest.mark.slow
def test_goals_out_of_reach_are_told_and_taken_back(pairs: Any, come: Any, irb140: Any) -> None:
    goal = qpsafe.FixedPose(shifted(irb140.pose("tcp", irb140.home), (1.5, 0.0, 0.0)))
    loop = pairs(lambda: qpsafe.SafetyController(irb140, [qpsafe.PositionTask("tcp", goal)]), 2)
    points = come(irb140, 2, 1600)
    told = set()
    for k in range(1600):
        tick = loop.step(lambda r, k=k: {"points": points[r][k] if 1100 < k < 1400 else np.zeros((0, 3))})
        told |= {tick.words(0)}
    held = ("held: it moved without getting nearer to its goals",)
    assert told - {("law: not solved as planned",)} == {(), held}  # ill-conditioned: the arm is stretched


@settings(max_examples=some(2, of=12), deadline=None)
@given(st.data())
def test_any_plain_parts_give_the_same_bits(pairs: Any, come: Any, irb140: Any, data: Any) -> None:
    """Rows, gains, thresholds, rules, admittance, limits and sensing as they come."""
    draw = data.draw
    frames = draw(st.lists(st.sampled_from(("tcp", "dh4", "flange")), min_size=1, max_size=3))
    numbers = st.sets(st.integers(0, 5), min_size=1)
    goals = [shifted(irb140.pose(frame, irb140.home), draw(st.sampled_from((0.0, 0.02)))) for frame in frames]
    tasks = [
        qpsafe.FrameTask(frame, qpsafe.FixedPose(goal), draw(st.floats(0.5, 20.0)), sorted(draw(numbers)))
        for frame, goal in zip(frames, goals, strict=True)
    ]
    thresholds = [qpsafe.Threshold(12.0, draw(st.floats(0.05, 0.15)))]
    for _ in tasks[1:]:  # together with the task above, or well before it
        below = qpsafe.Threshold(0.7 * thresholds[-1].delta, draw(st.floats(0.05, 0.15)))
        thresholds.append(draw(st.sampled_from((thresholds[-1], below))))
    rules = qpsafe.RecoveryRules(
        speed=draw(st.floats(0.1, 1.0)), shortest=draw(st.floats(0.05, 0.5)), fade=draw(st.floats(0.02, 0.3)),
        acceleration=draw(st.floats(0.2, 1.0)), ramp=draw(st.floats(0.02, 0.4)), enabled=draw(st.booleans()),
        calm=draw(st.floats(0.5, 1.0)), dwell=draw(st.floats(0.0, 0.4)), held=draw(st.booleans()),
    )  # fmt: skip
    evasion, share = (draw(st.floats(0.5, 5.0)), draw(st.floats(3.0, 20.0))), draw(st.floats(0.2, 1.0))
    law = qpsafe.HierarchicalLaw(damping=draw(st.sampled_from((0.0, 0.02))))

    def make() -> Any:
        return qpsafe.SafetyController(
            irb140, tasks, law, activation=qpsafe.Activation(tuple(thresholds)), evasion=qpsafe.Evasion(*evasion, 6),
            limits=qpsafe.JointLimits.of(irb140).gentler(share), recovery=rules,
        )  # fmt: skip

    loop = pairs(make, 2)
    points = come(irb140, 2, 200, draw(st.integers(0, 99)))
    for k in range(200):
        loop.step(lambda r, k=k: {"points": points[r][k]})
    assert loop.batch.compiled


def test_clocks_are_paused_and_robots_reset_one_by_one(pairs: Any, come: Any, irb140: Any) -> None:
    path = program(irb140, True)
    loop = pairs(lambda: qpsafe.SafetyController(irb140, [qpsafe.PositionTask("tcp", path)]), 4, 1e-9)
    points = come(irb140, 4, 300)
    for k in range(300):
        if k in (60, 120):
            for r in (0, 2):
                (loop.controllers[r].pause if k == 60 else loop.controllers[r].resume)()
            (loop.batch.pause if k == 60 else loop.batch.resume)([0, 2])
        if k == 180:
            loop.controllers[3].reset()
            loop.batch.reset([3])
        loop.step(lambda r, k=k: {"points": points[r][k]})


HANDS, HAND = (54, 287), 500  # seeds of such hands, and for how many ticks they are there


@pytest.mark.slow
def test_a_way_back_that_limits_block_goes_through_the_joints(pairs: Any, irb140: Any) -> None:
    """Hands around the tool that leave the arm where the straight way back is blocked."""
    rules = qpsafe.RecoveryRules(patience=0.2)
    loop = pairs(lambda: qpsafe.SafetyController(irb140, fixed_tasks(irb140), recovery=rules), 2)
    hands = []
    for seed in HANDS:
        rng = np.random.default_rng(seed)
        rate, phase = rng.uniform(0.3, 1.0, 3), rng.uniform(0.0, 6.28, 3)
        hands.append((rate, phase, irb140.pose("tcp", irb140.home)[:3, 3] + rng.uniform(-0.2, 0.2, 3)))
    led = [0, 0]
    for k in range(HAND + 800):
        seen = [
            (centre + 0.5 * np.sin(rate * k * 0.004 + phase))[None] if k < HAND else np.zeros((0, 3))
            for rate, phase, centre in hands
        ]
        loop.step(lambda r, seen=seen: {"points": seen[r]})
        led = [much + (loop.controllers[r].recovery.way is not None) for r, much in enumerate(led)]
        if min(led) > 200 and all(controller.recovery.phase == "following" for controller in loop.controllers):
            break
    assert min(led) > 200
    assert [controller.recovery.phase for controller in loop.controllers] == ["following"] * 2


@pytest.mark.parametrize(("name", "law"), first(1, [
    ("irb14000", None), ("iiwa14", qpsafe.HierarchicalLaw("paper")), ("irb140", None), ("irb140", qpsafe.WeightedLaw()),
]))  # fmt: skip
def test_rows_that_keep_clear_give_the_same_bits(pairs: Any, come: Any, name: str, law: Any) -> None:
    """Goals below a table, people who push the arm at it, and ways back over it."""
    robot = qpsafe.load_robot(name)
    tools, tip = len(robot.tool_frames), robot.pose(robot.tool_frames[0], robot.home)[:3, 3]
    table = Obstacle.box("table", (0.6, 0.5, 0.04), tip + np.array((0.0, 0.0, -0.12)))
    goals = {frame: qpsafe.FixedPose(shifted(robot.pose(frame, robot.home), (0.0, 0.0, -0.2)))
             for frame in robot.tool_frames}  # fmt: skip
    tasks = [
        kind(frame, goal) for kind in (qpsafe.PositionTask, qpsafe.OrientationTask) for frame, goal in goals.items()
    ]
    activation = qpsafe.robot_activation(robot, tools, tools) if tools > 1 else None
    loop = pairs(lambda: qpsafe.SafetyController(robot, tasks, law, known=[table], activation=activation), 3)
    ticks = some(220, of=350)
    points, rows = come(robot, 3, ticks), 0
    for k in range(ticks):
        loop.step(lambda r, k=k: {"points": points[r][k]})
        rows += any(limit.level(robot.at(q), qd, controller.limits) is not None for q, qd, controller, limit in
                    ((loop.q[r], loop.qd[r], c, c.clearance) for r, c in enumerate(loop.controllers)))  # fmt: skip
    assert loop.batch.compiled
    assert rows > 20
