"""What the gate promises, under commands that want the opposite."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from amounts import some

import qpsafe
from qpsafe.gate.gate import Gate
from qpsafe.gate.gated import NO_AGES
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.limits import JointLimits

ROBOTS = ("irb140", "iiwa14", "irb14000")
STRICTEST = VerifiedMotion(sidestep=math.inf)


@pytest.mark.parametrize("name", ROBOTS)
def test_nobody_who_could_be_touched_is_approached_and_nothing_is_touched(name: str, plays: Any) -> None:
    robot = qpsafe.load_robot(name)
    held = 0
    for seed in (2, 1, 0)[: some(1, of=3)]:
        told = plays.play(robot, seed, some(600, of=1_000), look=2, rules=STRICTEST)
        assert told.approach <= VerifiedMotion().approach + 1e-6
        assert told.short == 0
        assert told.kept_clear(VerifiedMotion().margin)
        assert told.excess <= 1e-12
        held += told.held
    assert held > some(50, of=100)  # the plays ask for what is not let through


@pytest.mark.parametrize("broken", ["fast", "appear"])
def test_where_people_do_what_was_not_reckoned_with_it_is_told(broken: str, plays: Any) -> None:
    robot = qpsafe.load_robot("irb140")
    shorts, brakes = 0, []
    for seed in range(some(1, of=4)):
        told = plays.play(
            robot,
            seed,
            800,
            fastest=6.0 if broken == "fast" else 1.6,
            appear=broken == "appear",
            people=6,
            rules=STRICTEST,
        )
        shorts += told.short
        brakes += told.retreats
        assert told.approach <= VerifiedMotion().approach + 1e-6  # wherever it is not told
        assert told.kept_clear(VerifiedMotion().margin)  # that holds whatever people do
        assert told.excess <= 1e-12
    assert shorts > 0
    assert all(brakes)  # braking at the limits, or all of a command that comes nearer by less


@pytest.mark.parametrize("sidestep", [0.0, VerifiedMotion().sidestep])
def test_who_steps_round_a_moving_link_is_told_or_not_approached(sidestep: float, plays: Any) -> None:
    """Where going away is allowed somebody may step into its way: it is told, and the robot brakes, or does less."""
    robot, shorts, rules = qpsafe.load_robot("irb140"), 0, VerifiedMotion(sidestep=sidestep)
    for seed in (5, 4, 0)[: some(1, of=3)]:
        told = plays.play(robot, seed, 1_000, people=8, rules=rules, look=8)
        assert told.approach <= rules.approach + 1e-6  # wherever it is not told
        assert told.kept_clear(rules.margin)
        assert all(told.retreats)
        shorts += told.short
    assert shorts > 0 or sidestep > 0.0  # the plays ask for it
    assert shorts <= 0.01 * 1_000 * some(1, of=3)  # rare: braking is enough in 99 of 100 ticks


def test_more_is_let_through_where_people_step_aside_for_a_shorter_time() -> None:
    robot, rng = qpsafe.load_robot("irb140"), np.random.default_rng(5)
    limits, times = JointLimits.of(robot), (0.0, VerifiedMotion().sidestep, 0.05, 0.2, math.inf)
    gates = [Gate(robot, VerifiedMotion(sidestep=time), limits) for time in times]
    counts = np.zeros(len(times), dtype=int)
    for _ in range(300):
        q = robot.home + rng.uniform(-0.3, 0.3, robot.nq)
        qd = rng.uniform(-0.5, 0.5, robot.nq) * robot.max_velocity
        points = robot.pose("tcp", q)[:3, 3] + rng.normal(0.0, 0.3, (2, 3))
        passed = []
        for gate in gates:
            command = limits.box(q, qd).clip(qd)
            gated = gate(q, qd, command, points, NO_AGES)
            passed.append(not gated.cause)
        assert passed == sorted(passed, reverse=True)
        counts += passed
    assert counts[0] > counts[2] > counts[-1]


@pytest.mark.slow
@pytest.mark.parametrize("rules", [STRICTEST, VerifiedMotion()], ids=["strictest", "default"])
@pytest.mark.parametrize("name", ROBOTS)
def test_a_million_ticks(name: str, rules: VerifiedMotion, plays: Any) -> None:
    robot, ticks = qpsafe.load_robot(name), 0
    for seed in range(1_000, 1_084):
        told = plays.play(robot, seed, 4_000, people=seed % 5, look=8, rules=rules)
        ticks += 4_000
        assert told.approach <= rules.approach + 1e-6, seed
        assert told.short == 0 or rules is not STRICTEST, seed
        assert told.excess <= 1e-12, seed
        assert told.kept_clear(rules.margin), seed
    assert ticks == 336_000  # a third of the million, a robot
