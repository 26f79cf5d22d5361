"""M and D by a rule from the robot, and those of the paper."""

from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.danger.evasion import SPEED_SHARE, TIME_SHARE, levers, virtual_torque
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.errors import ConfigurationError

ROBOTS = [qpsafe.load_robot(name) for name in ("irb140", "iiwa14", "irb14000")]


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_one_point_at_the_threshold_uses_its_share_of_the_joints_speed_and_no_more(robot: Any) -> None:
    """Danger Δ(1-ε) at any link, from any side: no joint is asked for more, and some one somewhere for nearly that."""
    evasion, high = qpsafe.Evasion.for_robot(robot, 0.004), robot_thresholds(robot)[0].start
    rng, largest = np.random.default_rng(1), 0.0
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    links = len(robot.wire_frames)
    for q in rng.uniform(lower, upper, (150, robot.nq)):
        state = robot.at(q)
        for link in range(links):
            forces = np.zeros((links, 3))
            direction = rng.normal(size=3)
            forces[link] = high * direction / np.linalg.norm(direction)
            steady = np.linalg.solve(evasion.damping, virtual_torque(state, forces))
            largest = max(largest, float((np.abs(steady) / robot.max_velocity).max()))
    assert 0.8 * SPEED_SHARE < largest < 1.05 * SPEED_SHARE


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_it_is_as_slow_as_its_share_of_the_time_to_full_speed(robot: Any) -> None:
    evasion = qpsafe.Evasion.for_robot(robot, 0.004)
    M, D = np.diag(evasion.mass), np.diag(evasion.damping)
    assert pytest.approx(TIME_SHARE * robot.max_velocity / robot.max_acceleration) == M / D
    assert np.ptp(D) == 0.0  # the steepest way out
    for _ in range(round(M[0] / D[0] / 0.004)):
        qd0 = evasion.step(D)
    assert qd0[0] == pytest.approx(1.0 - np.exp(-1.0), abs=0.05)


def test_the_first_experiments_values_are_those_of_other_shares() -> None:
    """M = 4 and D = 20 by hand are a quarter of the speed in 0.6 of the time."""
    robot, paper = ROBOTS[0], qpsafe.Evasion.paper(6, 0.004)
    own = qpsafe.Evasion.for_robot(robot, 0.004)
    assert np.diag(own.damping)[0] * SPEED_SHARE / 0.25 == pytest.approx(np.diag(paper.damping)[0], rel=0.02)
    time = robot.max_velocity[0] / robot.max_acceleration[0]
    assert np.diag(paper.mass)[0] / np.diag(paper.damping)[0] == pytest.approx(0.6 * time, rel=0.01)


def test_levers_bound_the_torque_at_home(irb140: Any) -> None:
    rng, longest = np.random.default_rng(2), levers(irb140)
    state = irb140.at(irb140.home)
    for link in range(6):
        forces = np.zeros((6, 3))
        forces[link] = rng.normal(size=3)
        assert (np.abs(virtual_torque(state, forces)) <= np.linalg.norm(forces[link]) * longest + 1e-12).all()


@pytest.mark.parametrize("given", ["paper", None])
def test_a_controller_is_told_which(irb140: Any, given: str | None) -> None:
    """By name or as it is: the same bits."""
    here = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    meant = qpsafe.Evasion(4.0, 20.0, 6) if given else qpsafe.Evasion.for_robot(irb140, 0.004)
    points = [irb140.pose("tcp", irb140.home)[:3, 3] + [0.2, 0.0, 0.1]]
    found = []
    for evasion in (given, meant):
        controller, q, qd = qpsafe.SafetyController(irb140, tasks, evasion=evasion), irb140.home, np.zeros(6)
        for _ in range(50):
            tick = controller.step(q, qd, points=points)
            q, qd = tick.reference.q, tick.reference.qd
        found.append(q)
    assert (found[0] == found[1]).all()
    assert (found[0] != irb140.home).any()


def test_another_name_is_refused(irb140: Any) -> None:
    here = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    with pytest.raises(ConfigurationError, match="evasion"):
        qpsafe.SafetyController(irb140, [qpsafe.PositionTask("tcp", here)], evasion="article")
