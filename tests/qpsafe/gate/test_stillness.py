"""A link that cannot get away stands before it is touched: another reckoning agrees, and plays at the bound end so."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import first, some
from numpy.typing import NDArray

import qpsafe
from qpsafe.gate.gate import Gate
from qpsafe.gate.pack import MOMENT
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.limits import KINDS, JointLimits
from qpsafe.pipeline.stages import Stages
from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

NAMES = ("irb140", "iiwa14", "irb14000")
FRESH = np.empty(0)
DT = 0.004


def drawn(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """A configuration and a velocity that the robot can have."""
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return rng.uniform(0.8 * lower, 0.8 * upper), rng.uniform(-0.6, 0.6, robot.nq) * robot.max_velocity


def beside(robot: Robot, q: Array, rng: np.random.Generator, count: int) -> Array:
    """Points around its links."""
    places, _ = Stages(robot, DT).link_parts.motion(robot.at(q))
    ends = places.reshape(-1, 3)
    return ends[rng.integers(len(ends), size=count)] + rng.normal(0.0, 0.15, (count, 3))


def reckoned(robot: Robot, rules: VerifiedMotion, q: Array, qd: Array, points: Array, leads: Array) -> Array:
    """The largest speeds, from capsules and Jacobians of another making."""
    limits, parts = JointLimits.of(robot, DT), Stages(robot, DT).link_parts
    a = limits.max_acceleration
    swift = np.minimum(limits.max_velocity, a * MOMENT)
    distances, rows = parts.approaches(robot.at(q), points)
    left = np.full(robot.nq, np.inf)
    for pair, (distance, row) in enumerate(zip(distances, rows, strict=True)):
        if np.abs(row) @ swift >= rules.escape:
            continue
        time = (distance - rules.radius(0.0)) / (rules.person_speed + max(row @ qd, 0.0)) - leads[pair % len(points)]
        moved = robot.tree.supports[parts.bodies[pair // len(points), 0]] != 0.0
        left[moved] = np.minimum(left[moved], max(time, 0.0))
    most, now = a * left, np.abs(qd)
    return np.where(most < now + a * DT, np.maximum(most, now - a * DT), np.inf)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("escape", [0.05, 0.2, 1.0, 100.0])
def test_what_is_held_is_what_another_reckoning_holds(name: str, escape: float) -> None:
    robot, rng, held, free = qpsafe.load_robot(name), np.random.default_rng(int(100 * escape)), 0, 0
    rules = VerifiedMotion(escape=escape)
    gate = Gate(robot, rules, JointLimits.of(robot, DT))
    for _ in range(some(15, of=150)):
        q, qd = drawn(robot, rng)
        points = beside(robot, q, rng, int(rng.integers(1, 6)))
        leads = rng.uniform(0.0, 0.1, len(points))
        most = gate.hold(robot.at(q), qd, points, FRESH, leads)
        expected = reckoned(robot, rules, q, qd, points, leads)
        np.testing.assert_allclose(np.full(robot.nq, np.inf) if most is None else most, expected, rtol=1e-9, atol=1e-9)
        held, free = held + int(np.isfinite(expected).sum()), free + int(np.isinf(expected).sum())
    assert free > 0
    assert held > some(5, of=20)


@pytest.mark.parametrize("name", NAMES)
def test_more_people_hold_no_less(name: str) -> None:
    robot, rng = qpsafe.load_robot(name), np.random.default_rng(3)
    gate = Gate(robot, VerifiedMotion(escape=1.0), JointLimits.of(robot, DT))
    for _ in range(100):
        q, qd = drawn(robot, rng)
        points = beside(robot, q, rng, 4)
        few, many = (gate.hold(robot.at(q), qd, seen, FRESH) for seen in (points[:2], points))
        assert few is None or (many is not None and (many <= few).all())


def test_nobody_and_no_escape_hold_nothing() -> None:
    robot, rng = qpsafe.load_robot("irb140"), np.random.default_rng(4)
    limits = JointLimits.of(robot, DT)
    q, qd = drawn(robot, rng)
    points = beside(robot, q, rng, 5)
    assert Gate(robot, VerifiedMotion(escape=100.0), limits).hold(robot.at(q), qd, points, FRESH) is not None
    assert Gate(robot, VerifiedMotion(escape=0.0), limits).hold(robot.at(q), qd, points, FRESH) is None
    assert Gate(robot, VerifiedMotion(escape=100.0), limits).hold(robot.at(q), qd, np.empty((0, 3)), FRESH) is None
    assert Gate(robot, VerifiedMotion(escape=100.0), limits).hold(robot.at(q), qd, points + 9.0, FRESH) is None


@pytest.mark.parametrize("name", first(1, NAMES))
def test_who_moves_as_reckoned_finds_the_link_at_rest(name: str) -> None:
    """Whatever joints do up to the bound, and however somebody comes at v_h: when touched they stand, to 2 ticks."""
    robot, rng, touched = qpsafe.load_robot(name), np.random.default_rng(7), 0
    limits, parts = JointLimits.of(robot, DT), Stages(robot, DT).link_parts
    rules = VerifiedMotion(escape=1e3, latency=0.0)  # no link gets away: all have to stand
    gate, a = Gate(robot, rules, limits), limits.max_acceleration
    for _ in range(some(8, of=25)):
        q, qd = drawn(robot, rng)
        p = beside(robot, q, rng, 1) + rng.normal(0.0, 0.5, (1, 3))
        target = int(rng.integers(len(parts.radii)))
        for tick in range(400):
            distances, _ = parts.approaches(robot.at(q), p)
            near = distances < rules.person_error
            if near.any():
                moved = (robot.tree.supports[parts.bodies[near, 0]] != 0.0).any(axis=0)
                if tick > 100:  # from where there was time
                    assert (np.abs(qd[moved]) <= 2.0 * a[moved] * DT + 1e-9).all()
                    touched += 1
                break
            most = gate.hold(robot.at(q), qd, p, FRESH)
            if tick < 100:  # nobody comes yet: the joints are brought to the bound
                p = p + (rng.normal(0.0, 0.5, (1, 3)) if distances.min() < 0.7 else 0.0)
            wish = np.clip(
                qd + rng.choice([-1.0, 0.5, 1.0], robot.nq) * a * DT, -limits.max_velocity, limits.max_velocity
            )
            qd = wish if most is None else np.clip(wish, -most, most)
            q = np.clip(q + qd * DT, robot.lower, robot.upper)
            if tick >= 100:
                way = parts.motion(robot.at(q))[0][target].mean(axis=0) - p[0]
                p = p + rules.person_speed * DT * way / max(float(np.linalg.norm(way)), 1e-9)
    assert touched >= some(3, of=10)


def test_a_hand_at_the_turntable_finds_it_at_rest_and_the_tick_says_so() -> None:
    robot = qpsafe.load_robot("irb140")
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    said: dict[float, set[str]] = {}
    speeds: dict[float, list[float]] = {}
    for escape in (0.2, 0.0):
        tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
        controller = qpsafe.SafetyController(robot, tasks, gate=VerifiedMotion(escape=escape))
        q, qd, said[escape], speeds[escape] = robot.home, np.zeros(6), set(), []
        for k in range(400):
            hand = np.array((0.9 - 0.0036 * k, -0.1, 0.25))
            torso = here.pose[:3, 3] + (0.5 - 0.001 * k, 0.1, 0.0)
            tick = controller.step(q, qd, points=[hand, torso])
            q, qd = tick.reference.q, tick.reference.qd
            said[escape] |= {words for words in tick.binding if words.endswith(KINDS[5])}
            speeds[escape].append(float(np.abs(qd[:2]).max()))
            assert tick.box is not None
            assert (tick.box.lower <= tick.box.upper).all()
    touch = 250  # the hand is within 0.1 m of the turntable's axis
    assert speeds[0.2][touch] == 0.0
    assert speeds[0.0][touch] > 0.05
    assert said[0.0] == set()
    assert any(words.startswith("joint_1") for words in said[0.2])


@pytest.mark.parametrize("seed", first(1, range(4)))
def test_a_batch_holds_the_same_joints_bit_by_bit(seed: int) -> None:
    robot, rng, held = qpsafe.load_robot("irb140"), np.random.default_rng(seed), 0

    def made() -> qpsafe.SafetyController:
        goal = robot.pose("tcp", robot.home)
        goal[:3, 3] += rng.normal(0.0, 0.1, 3) if seed else 0.0
        tasks = [
            qpsafe.PositionTask("tcp", qpsafe.FixedPose(goal)),
            qpsafe.OrientationTask("tcp", qpsafe.FixedPose(goal)),
        ]
        return qpsafe.SafetyController(robot, tasks)

    state = rng.bit_generator.state
    one = made()
    rng.bit_generator.state = state  # the same goal
    many = qpsafe.BatchController(made(), 1)
    assert many.compiled
    q, qd = robot.home, np.zeros(6)
    start, way = rng.uniform((0.6, -0.4, 0.1), (0.9, 0.4, 0.5)), rng.uniform(0.5, 1.5)
    for k in range(350):
        hand = np.array((0.0, 0.0, 0.25)) + (start - (0.0, 0.0, 0.25)) * max(1.0 - way * 0.004 * k, 0.15)
        seen = np.array([hand, start + np.array((0.0, 0.3, 0.3))])
        tick, both = one.step(q, qd, points=seen), many.step([q], [qd], points=[seen])
        np.testing.assert_array_equal(both.q[0], tick.reference.q)
        np.testing.assert_array_equal(both.qd[0], tick.reference.qd)
        held += any(words.endswith("stillness") for words in tick.binding)
        q, qd = tick.reference.q, tick.reference.qd
    assert held > 10


@pytest.mark.parametrize("max_jerk", [100.0, 1000.0])
def test_jerk_limits_give_way(max_jerk: float) -> None:
    robot, held, told = qpsafe.load_robot("irb140"), 0, 0
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    own = JointLimits.of(robot, DT)
    limits = JointLimits(
        own.lower, own.upper, own.max_velocity, own.max_acceleration, DT, max_jerk=np.full(6, max_jerk)
    )
    controller = qpsafe.SafetyController(robot, [qpsafe.PositionTask("tcp", here)], limits=limits)
    q, qd, before = robot.home, np.zeros(6), np.zeros(6)
    for k in range(200):
        hand = np.array((0.9 - 0.0064 * k, -0.1, 0.25))
        assert controller.verifies is not None
        most = controller.verifies.hold(robot.at(q), qd, hand[None], FRESH)
        tick = controller.step(q, qd, points=[hand])
        new = tick.reference.qd
        if most is not None:
            assert (np.abs(new) <= most + 1e-9).all()
            held += 1
        if np.abs((new - 2.0 * qd + before) / DT**2).max() > max_jerk * (1.0 + 1e-6):
            assert tick.box is not None
            assert KINDS.index("jerk") in tick.box.sacrificed  # and it is told
            assert any("jerk" in words for words in tick.messages)
            told += 1
        q, qd, before = tick.reference.q, new, qd
    assert held > 20
    assert told > 0


def test_gentle_limits_of_the_way_back_give_way(irb140: Robot) -> None:
    """On its way back a robot accelerates by a share of what it can; joints that are to stand brake by all of it."""
    here = irb140.pose("tcp", irb140.home)
    held, harder, a = 0, 0, irb140.max_acceleration * DT
    for seed in range(some(4, of=8)):
        rng, back = np.random.default_rng(seed), 0
        controller = qpsafe.SafetyController(irb140, [qpsafe.PositionTask("tcp", qpsafe.FixedPose(here))])
        q, qd, moment = irb140.home, np.zeros(6), int(rng.integers(10, 120))
        for k in range(500):
            if k == 200:  # whoever is within metres is there soon, and holds every joint
                controller.gate = VerifiedMotion(person_speed=30.0, escape=100.0)
            away = 0.6 - 0.002 * k if k < 200 else rng.uniform(1.5, 3.0) if moment <= back < moment + 5 else 20.0
            hand = here[:3, 3] + away * np.array((0.8, 0.0, 0.6))
            assert controller.verifies is not None
            most = controller.verifies.hold(controller.robot.at(q), qd, hand[None], FRESH)
            tick = controller.step(q, qd, points=[hand])
            if most is not None and tick.phase == "recovering":
                assert (np.abs(tick.reference.qd) <= most + 1e-9).all()
                held += 1
                harder += bool((np.abs(tick.reference.qd - qd) > 0.9 * a).any())
            q, qd, back = tick.reference.q, tick.reference.qd, back + (tick.phase == "recovering")
    assert held > some(10, of=20)
    assert harder > some(5, of=10)  # than the way back is allowed to
