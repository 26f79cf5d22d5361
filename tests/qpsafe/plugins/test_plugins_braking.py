"""`JointLimit` in a tick of bad input: however it comes, no joint is asked for more than its acceleration limit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import first, some
from ik_engines import DT, near

from qpsafe.plugins.monitor import DangerMonitor

NAN = np.full(6, np.nan)
#: What may be wrong: q, q̇, points.
BAD = {
    "points": (False, False, True),
    "position": (True, False, False),
    "velocity": (False, True, False),
    "velocity and points": (False, True, True),
    "everything": (True, True, True),
}


@pytest.mark.parametrize("seed", first(1, range(4)))
@pytest.mark.parametrize("wrong", [*BAD, "now this, now that"])
def test_bad_ticks_among_good_ones_never_ask_for_more_than_the_acceleration_limit(
    engine: Any, robot: Any, wrong: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    danger, q, qd, bad = DangerMonitor(robot, DT), np.array(robot.home), np.zeros(6), 0
    configuration, limit, evasive = engine.at(q), engine.plugin.JointLimit(danger), engine.plugin.EvasiveTask(danger)
    for tick in range(160):
        if tick % 40 == 0:  # goals far away: every joint accelerates as hard as it may
            hold = engine.frame(robot.pose("tcp", rng.uniform(robot.lower, robot.upper)), 1.0, 0.3, gain=0.5)
        is_bad = tick % 40 >= 20 and (tick % 40 == 20 or rng.random() < 0.7)
        kind = rng.choice([*BAD]) if wrong == "now this, now that" else wrong
        no_q, no_qd, no_points = BAD[kind] if is_bad else (False, False, False)
        points = [[np.nan] * 3] if no_points else [near(robot, q, 0.3)]
        danger.update(NAN if no_q else q, NAN if no_qd else qd, points)
        assert (danger.status == "bad_input") == is_bad
        last, qd = qd, engine.solve(configuration, [hold, evasive], [limit])
        assert np.all(np.abs(qd - last) <= robot.max_acceleration * DT + 1e-6), (tick, kind)
        if is_bad and not no_qd:  # from a velocity that is known it brakes as hard as it may
            most = robot.max_acceleration * DT
            np.testing.assert_allclose(qd, last - np.clip(last, -most, most), atol=1e-6)
        bad += is_bad
        q = q + qd * DT
        configuration.update(q)
    assert bad > 40


@pytest.mark.parametrize("wrong", [*BAD])
def test_bad_ticks_without_end_bring_the_robot_to_rest_inside_its_limits(engine: Any, robot: Any, wrong: str) -> None:
    danger, q, qd = DangerMonitor(robot, DT), np.array(robot.home), np.zeros(6)
    configuration, limit = engine.at(q), engine.plugin.JointLimit(danger)
    goal = engine.posture(robot.upper + 1.0, 1.0, gain=0.5)
    no_q, no_qd, no_points = BAD[wrong]
    for tick in range(some(300, of=600)):
        bad = tick >= 60
        points = [[np.nan] * 3] if bad and no_points else []
        danger.update(NAN if bad and no_q else q, NAN if bad and no_qd else qd, points)
        qd = engine.solve(configuration, [goal], [limit])
        q = q + qd * DT
        configuration.update(q)
        if tick == 60:
            assert np.abs(qd).max() > 0.5
    np.testing.assert_allclose(qd, 0.0, atol=1e-6)
    assert np.all((q >= robot.lower - 1e-6) & (q <= robot.upper + 1e-6))
