"""Low danger on seven joints: the null space makes way, the tool stays; on six joints nothing moves."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import first

import qpsafe


def evade(robot, person, law=None, ticks=1000, extra=(), **options):
    """Run beside a person; every tick's regime, tool errors, and the configuration at the end."""
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here), *extra]
    evasion = qpsafe.Evasion(0.4, 2.0, robot.nq)
    controller = qpsafe.SafetyController(robot, tasks, law, evasion=evasion, **options)
    q, qd, log = robot.home, np.zeros(robot.nq), []
    for k in range(ticks):
        points = person(k) if callable(person) else [person]
        tick = controller.step(q, qd, points=points)
        q, qd = tick.reference.q, tick.reference.qd
        log.append((tick.regime, tick.status, tick.cdf_n, *map(np.linalg.norm, tick.errors[:2])))
    return log, q


@pytest.fixture(scope="module")
def iiwa():
    return qpsafe.load_robot("iiwa14")


CASES = [(0.0, 1.0, 0.0, "strict"), (0.0, -1.0, 0.0, "paper"), (0.0, 0.9, 0.45, "strict"), (0.0, 1.0, 0.0, "source")]


@pytest.mark.parametrize("case", first(2, [(case,) for case in CASES]), ids=str)
def test_the_elbow_makes_way_and_the_tool_stays(iiwa, case):
    elbow = iiwa.pose("dh3", iiwa.home)[:3, 3]
    person = elbow + 1.2 * np.array(case[:3])
    law = qpsafe.NullspaceLaw() if case[3] == "source" else qpsafe.HierarchicalLaw(case[3])
    log, q = evade(iiwa, person, law, ticks=600)
    assert {(regime, status) for regime, status, *_ in log} == {("low", "ok")}
    position, orientation = (max(column) for column in list(zip(*log, strict=True))[3:])
    assert position < 1e-3
    assert orientation < 1e-3
    gained = np.linalg.norm(iiwa.pose("dh3", q)[:3, 3] - person) - np.linalg.norm(elbow - person)
    assert gained > 0.04
    assert log[-1][2] < log[0][2]  # less danger


def test_left_and_right_are_mirror_images(iiwa):
    """The home pose lies in the plane y = 0: joints about z change sign, the others do not."""
    elbow = iiwa.pose("dh3", iiwa.home)[:3, 3]
    left, right = (evade(iiwa, elbow + np.array([0.0, side, 0.0]), ticks=250)[1] for side in (1.2, -1.2))
    mirror = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    np.testing.assert_allclose(right, mirror * left, atol=1e-9)
    assert np.abs(left - iiwa.home).max() > 0.03


def test_on_six_joints_nothing_is_left_to_move():
    robot = qpsafe.load_robot("irb140")
    log, q = evade(robot, robot.pose("dh3", robot.home)[:3, 3] + [0.0, 1.4, 0.0], ticks=200)
    assert {regime for regime, *_ in log} == {"low"}
    np.testing.assert_allclose(q, robot.home, atol=1e-6)


@pytest.mark.slow
def test_a_posture_as_the_last_task_brings_the_elbow_back(iiwa):
    """Released first, by a threshold of its own, and taken up again when the person has gone."""
    elbow = iiwa.pose("dh3", iiwa.home)[:3, 3]
    thresholds = (qpsafe.Threshold(12.44, 0.15), qpsafe.Threshold(8.12, 0.25), qpsafe.Threshold(4.5, 0.1))
    options = {"extra": [qpsafe.PostureTask(iiwa.home, gain=3.0)], "activation": qpsafe.Activation(thresholds)}
    near = elbow + np.array([0.0, 1.2, 0.0])
    _, away = evade(iiwa, near, ticks=600, **options)
    assert np.linalg.norm(iiwa.pose("dh3", away)[:3, 3] - elbow) > 0.05
    log, back = evade(iiwa, lambda k: [near] if k < 600 else [], ticks=1400, **options)
    np.testing.assert_allclose(back, iiwa.home, atol=1e-3)
    assert max(row[3] for row in log) < 1e-3
