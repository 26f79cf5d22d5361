"""A robot that does not get on says so, by what it is blocked, and stands still; it finds back where it can."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import first, some

import qpsafe
from qpsafe.tasks.moves import Line, Rates

NOTHING = np.empty((0, 3))
BESIDE = np.array([[0.05, 0.0, 0.05]])  # [m] from the tip: high danger
OVER = np.array([[0.05, 0.1, 0.2]])


#: The evasion and the pace of the return that the paper has.
PAPER: Any = {"evasion": "paper", "recovery": qpsafe.RecoveryRules.paper()}


def tasks_on(trajectory: Any) -> list[Any]:
    return [qpsafe.PositionTask("tcp", trajectory), qpsafe.OrientationTask("tcp", trajectory)]


def home(tick: Any) -> bool:
    return bool(tick.phase == "following" and max(np.linalg.norm(e) for e in tick.errors) < 5e-4)


def after_a_hand(run: Any, robot: Any, seed: int, hand: float = 60.0) -> Any:
    """The last tick, and the ticks at rest: a hand moves around the tool, leaves, and a minute passes at most."""
    loop = run()
    rng = np.random.default_rng(seed)
    rate, phase = rng.uniform(0.3, 1.0, 3), rng.uniform(0.0, 6.28, 3)
    centre = robot.pose("tcp", robot.home)[:3, 3] + rng.uniform(-0.2, 0.2, 3)
    for k in range(round(hand / 0.004)):
        loop.step((centre + 0.5 * np.sin(rate * k * 0.004 + phase))[None])
    still = 0
    for _ in range(15000):
        tick = loop.step(NOTHING)
        still = still + 1 if not np.abs(loop.qd).max() > 1e-4 else 0
        if still > 1250:
            break
    return tick, still


def comes_home_or_says_why_not(run: Any, robot: Any, seed: int) -> bool:
    tick, still = after_a_hand(run, robot, seed)
    assert still > 1250, "it jitters"
    home = tick.phase == "following" and all(np.linalg.norm(e) < 5e-3 for e in tick.errors)
    assert home or (tick.status == "degraded" and "goals" in tick.messages[0]), tick.explain()
    return bool(home)


@pytest.mark.slow
def test_a_way_back_that_limits_block_goes_through_the_joints(run: Any, irb140: Any) -> None:
    assert comes_home_or_says_why_not(run, irb140, 1)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 1200, 20))
def test_two_hundred_hands(run: Any, irb140: Any, first: int) -> None:
    assert all(comes_home_or_says_why_not(run, irb140, seed) for seed in range(first, first + 20))


def test_danger_on_the_way_through_the_joints_suspends_it(run: Any, irb140: Any) -> None:
    loop = run(recovery=qpsafe.RecoveryRules.paper())  # on its way at once
    for _ in range(100):
        loop.step(NOTHING)
    tip = irb140.pose("tcp", irb140.home)[:3, 3]
    loop.step(tip + BESIDE)
    loop.step(NOTHING)
    assert loop.controller.recovery.phase == "recovering"
    goal = irb140.home + 0.4
    assert loop.controller.recovery.lead(goal)
    assert not loop.controller.recovery.lead(goal)  # once between two dangers
    before = loop.q
    for _ in range(200):
        tick = loop.step(NOTHING)
    assert np.linalg.norm(goal - loop.q) < np.linalg.norm(goal - before)
    assert tick.phase == "recovering"
    assert tick.waits_for
    here = irb140.pose("tcp", loop.q)[:3, 3]
    tick = loop.step(here + BESIDE)
    assert tick.phase == "suspended"
    assert loop.controller.recovery.way is None
    assert any(home(loop.step(NOTHING)) for _ in range(4000))


def test_the_way_through_the_joints_ends_at_its_posture_and_then_on_the_path(run: Any, irb140: Any) -> None:
    loop = run(q=irb140.home + 0.2, recovery=qpsafe.RecoveryRules.paper())
    loop.step(irb140.pose("tcp", loop.q)[:3, 3] + BESIDE)
    loop.step(NOTHING)
    recovery, goal = loop.controller.recovery, irb140.home + np.array((0.3, -0.2, 0.1, 0.2, -0.3, 0.4))
    assert recovery.phase == "recovering"
    assert recovery.lead(goal)
    reached = False
    for _ in range(4000):
        tick = loop.step(NOTHING)
        reached |= float(np.abs(loop.q - goal).max()) < 1e-3
        if recovery.way is not None:
            assert np.abs(loop.qd).max() < 1.1 * loop.controller.recovery_rules.joint_speed
        if reached and home(tick):
            break
    assert reached
    assert home(tick)


@pytest.mark.parametrize("seed", first(1, range(4)))
def test_goals_out_of_reach_are_named_and_the_robot_stands(run: Any, irb140: Any, seed: int) -> None:
    """Anywhere, from just beyond the reach to 5 m away, in any orientation."""
    rng = np.random.default_rng(seed)
    way = rng.normal(size=3)
    goal = irb140.pose("tcp", rng.uniform(irb140.lower, irb140.upper))
    goal[:3, 3] = np.array([0.0, 0.0, 0.35]) + way / np.linalg.norm(way) * rng.choice([1.2, 2.0, 5.0])
    loop = run(tasks=tasks_on(qpsafe.FixedPose(goal)))
    for _ in range(some(3000, of=5000)):
        tick = loop.step(NOTHING)
    assert tick.status == "degraded"
    assert "position by" in tick.messages[0]
    assert np.abs(loop.qd).max() < 0.01
    for i, name in enumerate(irb140.joint_names):  # and what it says of limits is so
        low, high = loop.q[i] < irb140.lower[i] + 1e-3, loop.q[i] > irb140.upper[i] - 1e-3
        assert (f"{name} at its lower limit" in tick.messages[0]) == low
        assert (f"{name} at its upper limit" in tick.messages[0]) == high


@pytest.mark.slow
def test_a_line_out_of_reach_is_named_on_the_way(run: Any, irb140: Any) -> None:
    start = irb140.pose("tcp", irb140.home)
    goal = start.copy()
    goal[0, 3] += 5.0
    loop = run(tasks=tasks_on(Line(start, goal, Rates(1.0, 2.0, 20.0))))
    found = [loop.step(NOTHING).messages for _ in range(2500)]
    said = [k for k, messages in enumerate(found) if messages]
    assert "falls behind its goals" in found[said[0]][0]
    assert "position by" in found[-1][0]
    assert "out of reach" in found[-1][0] or "limit" in found[-1][0]


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in (1, 2))])
def test_what_is_explained_is_not_said(run: Any, irb140: Any, seed: int) -> None:
    """Moves within reach, danger that comes and goes, a hand that stays: never a word."""
    rng = np.random.default_rng(seed)
    start = irb140.pose("tcp", irb140.home)
    goal = start.copy()
    goal[:3, 3] += rng.uniform(-0.1, 0.1, 3)
    loop = run(tasks=tasks_on(Line(start, goal, Rates(0.1, 0.5, 5.0))), **PAPER)
    tip = start[:3, 3]
    for k in range(2500):
        danger = 200 < k < 1500  # more than 5 s of it
        tick = loop.step(tip + OVER if danger else NOTHING)
        assert tick.messages == ()
    assert max(np.linalg.norm(e) for e in tick.errors) < 1e-3


@pytest.mark.slow
def test_what_was_said_is_taken_back_when_the_goal_changes(run: Any, irb140: Any) -> None:
    """And the robot comes back from where it got to, though a limit blocks the straight way."""
    far = irb140.pose("tcp", irb140.home)
    far[0, 3] += 2.0
    loop = run(**PAPER)  # faster, by default, it ends at a limit of joint 5, and says so
    loop.step(NOTHING)
    home = loop.controller.tasks
    loop.controller.set_tasks(tasks_on(qpsafe.FixedPose(far)))
    for _ in range(4000):
        tick = loop.step(NOTHING)
    assert tick.messages
    loop.controller.set_tasks(home)
    for _ in range(6000):
        tick = loop.step(NOTHING)
    assert tick.status == "ok"
    assert tick.phase == "following"
    assert max(np.linalg.norm(e) for e in tick.errors) < 1e-3
