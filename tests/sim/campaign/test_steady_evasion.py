"""Somebody stands still beside the robot, whose servos are late: evasion comes to rest, and does not swing."""

from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.sim.campaign.trials.servo import Servo
from qpsafe.sim.campaign.trials.work import _reversals

POINTS = ((0.25, 0.0, 0.0), (0.15, 0.15, 0.0), (0.1, -0.2, 0.1), (0.05, 0.05, -0.25), (0.0, 0.3, 0.1))
ROBOTS = {name: qpsafe.load_robot(name) for name in ("irb140", "iiwa14")}


@pytest.mark.parametrize(("name", "lag"), first(1, product(ROBOTS, [0.02, 0.0, 0.008])))
def test_whatever_the_lag_there_is_no_limit_cycle(name: str, lag: float) -> None:
    """While the arm gets away joints may turn round once each; from then on it creeps to rest."""
    robot: Any = ROBOTS[name]
    frame = robot.tool_frames[0]
    here = qpsafe.FixedPose(robot.pose(frame, robot.home))
    for place in POINTS:
        tasks = [qpsafe.PositionTask(frame, here), qpsafe.OrientationTask(frame, here)]
        controller, servo = qpsafe.SafetyController(robot, tasks), Servo(robot.home, lag)
        speeds, phases = [], []
        for _ in range(600):
            tick = controller.step(servo.q, servo.qd, points=[here.sample(0.0).pose[:3, 3] + place])
            servo.follow(tick.reference.q, tick.reference.qd)
            speeds.append(tick.reference.qd)
            phases.append(tick.phase)
        qd = np.array(speeds)
        assert np.abs(qd).max() > 0.2  # it does get away
        assert _reversals(qd) <= robot.nq
        assert _reversals(qd[350:]) <= 1
        assert np.abs(qd[500:]).max() < 0.15
        assert sum(a != "suspended" == b for a, b in pairwise(phases)) <= 1
