"""The gate as the last step of a controller's tick."""

from __future__ import annotations

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.gate.gate import Gate
from qpsafe.gate.gated import NO_AGES, TOO_NEAR
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.limits import JointLimits
from qpsafe.sensing.hulls import Obstacle
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.trajectory import FixedPose

ROBOT = qpsafe.load_robot("irb140")
POSE = ROBOT.pose("tcp", ROBOT.home)
NOBODY = np.empty((0, 3))


def towards(metres: float, **parts: object) -> qpsafe.SafetyController:
    """A controller whose tool wants to be so far ahead."""
    goal = POSE.copy()
    goal[0, 3] += metres
    return qpsafe.SafetyController(ROBOT, [PositionTask("tcp", FixedPose(goal), gain=20.0)], **parts)


def run(controller: qpsafe.SafetyController, ticks: int, points: object = NOBODY) -> list[qpsafe.Tick]:
    q, qd, told = ROBOT.home, np.zeros(6), []
    for _ in range(ticks):
        told.append(controller.step(q, qd, points=points))
        q, qd = told[-1].reference.q, told[-1].reference.qd
    return told


WALL = Obstacle.box("wall", (0.1, 1.0, 1.0), POSE[:3, 3] + (0.15, 0.0, 0.0))


def test_a_wall_in_the_way_is_not_touched_and_named() -> None:
    told = run(towards(0.3, known=[WALL], clearance="off"), 400)
    held = [tick.gate for tick in told if tick.gate.cause]
    assert held
    assert {gated.cause for gated in held} == {"furniture"}
    assert {gated.other for gated in held} == {"wall"}
    assert all(gated.verified and 0.0 <= gated.share <= 1.0 for gated in held)
    assert ROBOT.pose("tcp", told[-1].reference.q)[0, 3] < POSE[0, 3] + 0.1
    assert "near wall (furniture)" in [tick for tick in told if tick.gate.cause][-1].explain()
    free = run(towards(0.3, known=[WALL], gate="off", clearance="off"), 400)
    assert ROBOT.pose("tcp", free[-1].reference.q)[0, 3] > POSE[0, 3] + 0.2  # it does go there otherwise


def test_what_holds_the_arm_off_its_goal_is_named() -> None:
    said = run(towards(0.3, known=[WALL]), 1200)[-1].messages
    assert "stands off its goals" in said[0]
    assert "mm from wall" in said[0]
    assert "out of reach" not in said[0]


def test_with_nothing_in_the_way_it_changes_nothing() -> None:
    for with_gate, without in zip(run(towards(0.1), 200), run(towards(0.1, gate="off"), 200), strict=True):
        np.testing.assert_array_equal(with_gate.reference.q, without.reference.q)
        assert not with_gate.gate.cause
        assert with_gate.gate.share == 1.0


def test_without_limits_it_is_off() -> None:
    controller = towards(0.3, known=[WALL], limits="off")
    assert controller.verifies is None
    assert not any(tick.gate.cause for tick in run(controller, 50))


def test_figures_are_exchanged_from_one_tick_to_the_next() -> None:
    controller, q = towards(0.3, known=[WALL], clearance="off"), ROBOT.home
    run(controller, 1)
    controller.gate = "off"
    assert (controller.gate, controller.verifies) == ("off", None)
    controller.gate = VerifiedMotion(margin=0.05)
    last = controller.step(q, np.zeros(6), points=NOBODY)
    for _ in range(400):
        last = controller.step(last.reference.q, last.reference.qd, points=NOBODY)
    assert 0.1 - (ROBOT.pose("tcp", last.reference.q)[0, 3] - POSE[0, 3]) > 0.05 - 0.01
    with pytest.raises(ConfigurationError, match=r"gate.*'on'.*VerifiedMotion or \"off\""):
        controller.gate = "on"  # type: ignore[assignment]
    controller.limits = JointLimits.of(ROBOT).gentler(0.5)
    assert controller.verifies is not None
    assert controller.verifies.limits is controller._braking


@given(
    key=st.sampled_from(
        ("person_speed", "latency", "servo_lag", "person_error", "approach", "margin", "sidestep", "escape")
    ),
    value=st.sampled_from((-1.0, math.nan, math.inf, "1", b"1", "one", None, True, np.True_, [], 10**400)),
)
def test_figures_that_are_none_are_refused_by_name(key: str, value: object) -> None:
    if (key, value) == ("sidestep", math.inf):  # the strictest promise
        assert VerifiedMotion(sidestep=math.inf).sidestep == math.inf
        return
    with pytest.raises(ConfigurationError, match=key):
        VerifiedMotion(**{key: value})  # type: ignore[arg-type]


def test_old_readings_make_the_reach_larger() -> None:
    """What passes with a fresh reading does not with one that is 40 ms old, and stale ones do not count at all."""
    gate = Gate(ROBOT, VerifiedMotion(), JointLimits.of(ROBOT), max_age=0.04)
    q, qd = ROBOT.home, np.zeros(6)
    shares = {}
    for ahead in np.arange(0.05, 0.6, 0.005):
        point = POSE[:3, 3][None] + (ahead, 0.0, 0.0)
        for age in (0.0, 0.04, 1.0, -1.0, math.nan):
            qd = np.array([0.0, 0.3, 0.3, 0.0, 0.0, 0.0])
            command = qd.copy()
            shares[ahead, age] = gate(q, qd, command, point, np.array([age])).share
    for ahead in np.arange(0.05, 0.6, 0.005):
        assert shares[ahead, 0.04] <= shares[ahead, 0.0]
        assert shares[ahead, 1.0] == shares[ahead, -1.0] == shares[ahead, math.nan] == shares[ahead, 0.0]
    assert sum(shares[ahead, 0.04] < shares[ahead, 0.0] for ahead in np.arange(0.05, 0.6, 0.005)) >= 5


def test_somebody_who_appears_before_a_moving_tool_is_told_by_the_tick_and_by_the_batch() -> None:
    controller = towards(0.3)
    many = qpsafe.BatchController(towards(0.3), 2)
    assert many.compiled
    q, qd = ROBOT.home, np.zeros(6)
    for k in range(60):
        near = ROBOT.pose("tcp", q)[:3, 3][None] + (0.05, 0.0, 0.0) if k == 40 else NOBODY
        tick = controller.step(q, qd, points=near)
        both = many.step([q, q], [qd, qd], points=[near, NOBODY])
        assert (TOO_NEAR in tick.messages) is (tick.gate.short > 1e-3) is (k == 40)
        assert tick.status == ("degraded" if k == 40 else "ok")
        if k == 40:
            assert TOO_NEAR in both.words(0)
            assert TOO_NEAR not in both.words(1)
        q, qd = tick.reference.q, tick.reference.qd


def test_copies_and_pickles_go_on_alike() -> None:
    controller = towards(0.3, known=[WALL])
    run(controller, 30)
    others = copy.deepcopy(controller), pickle.loads(pickle.dumps(controller)), copy.copy(controller)
    told = [one.step(ROBOT.home, np.zeros(6), points=NOBODY) for one in (controller, *others)]
    assert all(tick == told[0] for tick in told)


@given(seed=st.integers(0, 2**31))
def test_no_number_gets_past_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rules = VerifiedMotion(person_speed=rng.choice([0.0, 1.6]), escape=rng.choice([0.2, 1e300]))
    gate = Gate(ROBOT, rules, JointLimits.of(ROBOT), [WALL])
    points = rng.normal(size=(rng.integers(0, 40), 3)) * rng.choice([1e-6, 1.0, 1e6, 1e300])
    q = rng.uniform(ROBOT.lower, ROBOT.upper)
    qd = rng.uniform(-1, 1, 6) * ROBOT.max_velocity * rng.choice([0.0, 1.0])
    limits = JointLimits.of(ROBOT)
    box = limits.box(q, qd)
    command = rng.uniform(box.lower, box.upper)
    gated = gate(q, qd, command, points, NO_AGES)
    assert np.isfinite(command).all()
    assert (command >= box.lower - 1e-12).all()
    assert (command <= box.upper + 1e-12).all()
    assert 0.0 <= gated.share <= 1.0
    assert math.isfinite(gated.short)
    most = gate.hold(ROBOT.at(q), qd, points, NO_AGES)
    if most is not None:  # braking is always among what is allowed
        assert (most >= np.maximum(np.abs(qd) - limits.max_acceleration * limits.dt, 0.0)).all()
