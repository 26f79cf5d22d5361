"""`DangerLimit.guard`: whatever it is given in whatever tick, nothing beyond the joint limits comes back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import some
from ik_engines import DT, near

import qpsafe
from qpsafe.plugins.monitor import DangerMonitor

NAN = np.full(6, np.nan)
VELOCITIES = {
    "slow": lambda rng: rng.uniform(-0.1, 0.1, 6),
    "fast": lambda rng: rng.uniform(-20.0, 20.0, 6),
    "absurd": lambda rng: rng.choice([-1e300, 1e300, 1.0], 6),
    "one infinite": lambda rng: np.where(np.arange(6) == rng.integers(6), np.inf, 0.3),
    "one not a number": lambda rng: np.where(np.arange(6) == rng.integers(6), np.nan, 0.3),
    "none a number": lambda rng: NAN,
    "whole": lambda rng: rng.integers(-9, 9, 6),
    "a list": lambda rng: rng.uniform(-5.0, 5.0, 6).tolist(),
}
TICKS = {
    "good": lambda q, qd, points: (q, qd, points),
    "q": lambda q, qd, points: (NAN, qd, points),
    "qd": lambda q, qd, points: (q, NAN, points),
    "points": lambda q, qd, points: (q, qd, [[np.nan] * 3]),
    "all": lambda q, qd, points: (NAN, NAN, None),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", VELOCITIES)
def test_what_comes_back_is_within_the_joint_limits(engine: Any, robot: Any, kind: str) -> None:
    rng = np.random.default_rng(7)
    danger, q, qd = DangerMonitor(robot, DT), np.array(robot.home), np.zeros(6)
    limit, configuration, slowed = engine.plugin.DangerLimit(danger, 9.0), engine.at(q), 0
    for tick in range(some(60, 600)):
        bad = "good" if tick % 10 < 5 else rng.choice([*TICKS])
        danger.update(*TICKS[bad](q, qd, [near(robot, q, 0.5)]))
        given = VELOCITIES[kind](rng)
        guarded = limit.guard(configuration, given)
        assert guarded.shape == (6,)
        assert np.all((guarded >= danger.box.lower) & (guarded <= danger.box.upper))
        assert np.all(np.abs(guarded - qd) <= robot.max_acceleration * DT + 1e-9), (tick, bad)
        if not np.all(np.abs(given) < 1e5):
            np.testing.assert_array_equal(guarded, danger.box.clip(np.zeros(6)))
        slowed += bool(np.any(guarded != given))
        qd = guarded
        q = q + qd * DT
        configuration.update(q)
    assert kind == "slow" or slowed > 30


def test_without_limits_what_is_not_finite_becomes_standstill(engine: Any, robot: Any) -> None:
    danger = DangerMonitor(robot, DT, limits="off")
    limit, home = engine.plugin.DangerLimit(danger, 9.0), engine.at(robot.home)
    danger.update(robot.home, np.zeros(6), [near(robot, robot.home, 0.5)])
    np.testing.assert_array_equal(limit.guard(home, NAN), np.zeros(6))


@pytest.mark.parametrize(
    "velocity",
    [
        [1, 2, 3], 5.0, None, "x", np.ones((6, 1)), np.ones(7), np.ones(6) + 1j, np.ones(6) > 0.0, np.array(["1"] * 6),
        np.ma.masked_all(6), [None] * 6, {}, [10**400] * 6,
    ],
)  # fmt: skip
def test_what_is_no_velocity_is_named(engine: Any, robot: Any, velocity: Any) -> None:
    danger = DangerMonitor(robot, DT)
    danger.update(robot.home, np.zeros(6), [])
    with pytest.raises(qpsafe.ConfigurationError, match=r"(?s)guard: velocity.* expected .*6"):
        engine.plugin.DangerLimit(danger, 9.0).guard(engine.at(robot.home), velocity)


def test_a_call_with_another_tick_is_refused_where_it_can_be_known(engine: Any, robot: Any) -> None:
    """Tasks are not told the tick of a call: `SameTick` is."""
    danger, plugin, home = DangerMonitor(robot, DT), engine.plugin, engine.at(robot.home)
    danger.update(robot.home, np.zeros(6), [])
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    clik = plugin.ClikTask(qpsafe.PositionTask("tcp", goal), robot, 0.01)
    tasks = [plugin.EvasiveTask(danger), engine.posture(robot.home, 1.0, 0.1)]
    assert np.isfinite(engine.solve(home, tasks, [plugin.SameTick(danger)])).all()
    for parts, word in (((clik,), r"ClikTask, 0\.01"), ((danger, clik), r"ClikTask, 0\.01")):
        with pytest.raises(qpsafe.ConfigurationError, match=word):
            engine.solve(home, [*tasks, clik], [plugin.SameTick(*parts)])
    for limit in (plugin.SameTick(danger), plugin.JointLimit(danger), plugin.DangerLimit(danger, 9.0)):
        with pytest.raises(qpsafe.ConfigurationError, match=r"DangerMonitor, 0\.004 s"):
            limit.compute_qp_inequalities(home, 0.02)
    for parts in ((), (robot,), (danger, None)):
        with pytest.raises(qpsafe.ConfigurationError, match="parts"):
            plugin.SameTick(*parts)
