"""`DangerMonitor`: whatever comes as points, and whatever its parts are exchanged for."""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from ik_engines import DT, near, watch

import qpsafe
from qpsafe.plugins.monitor import DangerMonitor

ROBOT = qpsafe.load_robot("irb140")
REST = np.zeros(6)
MOVED = np.array([[0.0, -1.0, 0.0, 2.0], [1.0, 0.0, 0.0, -1.0], [0.0, 0.0, 1.0, 0.5], [0.0, 0.0, 0.0, 1.0]])


class Raises:
    """Raises whatever is asked of it."""

    def __array__(self, *args: Any, **kwargs: Any) -> Any:
        raise RuntimeError("array")


POINTS = {
    "masked": lambda x: np.ma.array(x, mask=np.arange(x.size).reshape(x.shape) == 1),
    "a mask that hides nothing": lambda x: np.ma.array(x),
    "complex": lambda x: x + 1j,
    "text": lambda x: x.astype(str),
    "truth": lambda x: x > 0.0,
    "dates": lambda x: x.astype("M8[D]"),
    "objects": lambda x: x.astype(object),
    "none": lambda x: None,
    "raises": lambda x: Raises(),
    "huge": lambda x: [[10**400] * 3],
    "largest": lambda x: 1.7e308 * np.sign(x),
    "infinite": lambda x: np.where(x > 0.5, np.inf, x),
    "not a number": lambda x: np.where(x > 0.5, np.nan, x),
    "flat": lambda x: x.ravel(),
    "two columns": lambda x: x[:, :2],
    "columns": lambda x: x.T.copy(),
    "ragged": lambda x: [[1.0], [1.0, 2.0]],
    "float32": lambda x: x.astype(np.float32),
    "lists": lambda x: x.tolist(),
    "none in sight": lambda x: [],
    "a million": lambda x: np.broadcast_to(x[0], (1_000_000, 3)),
    "a cloud": lambda x: np.tile(x, (400, 1)),
    "right": lambda x: x,
}


@pytest.mark.filterwarnings("error")
@given(st.sampled_from(sorted(POINTS)), st.integers(0, 2**32 - 1))
@settings(max_examples=some(60, 600), deadline=None)
def test_points_are_judged_alike_wherever_the_robot_stands(kind: str, seed: int) -> None:
    right = np.random.default_rng(seed).uniform(-1.5, 1.5, (4, 3))
    found = []
    for base in (None, np.eye(4)):
        danger = DangerMonitor(ROBOT, DT, base=base)
        danger.update(ROBOT.home, REST, POINTS[kind](right))
        assert np.isfinite(danger.qd0).all()
        found.append((danger.status, danger.message, danger.switches, danger.points.tolist()))
    assert found[0][:3] == found[1][:3]
    np.testing.assert_allclose(found[0][3], found[1][3])


def test_a_point_that_is_masked_is_bad_input_and_counts_for_nothing() -> None:
    points = np.ma.array([near(ROBOT, ROBOT.home, 0.3), [9.0, 9.0, 9.0]], mask=[[0, 0, 0], [1, 1, 1]])
    for base in (None, np.eye(4), MOVED):
        danger = DangerMonitor(ROBOT, DT, base=base)
        danger.update(ROBOT.home, REST, points)
        assert danger.status == "bad_input"
        assert "masked" in danger.message


@pytest.mark.parametrize("base", [None, MOVED])
def test_clouds_are_reduced_or_refused_as_by_the_controller(base: Any) -> None:
    rng, goal = np.random.default_rng(1), qpsafe.FixedPose(ROBOT.pose("tcp", ROBOT.home))
    controller = qpsafe.SafetyController(ROBOT, [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)])
    for count in (1_000, 1_001, 15_000, 20_001, 300_000):
        points = rng.normal(size=(count, 3)) * 2.0 + 3.0
        there = points if base is None else points @ base[:3, :3].T + base[:3, 3]
        danger = DangerMonitor(ROBOT, controller.dt, ramp=0.0, base=base)
        begin = process_time()
        danger.update(ROBOT.home, REST, there)
        taken = process_time() - begin
        tick = controller.step(ROBOT.home, REST, points=points)
        assert (danger.status == "ok") == (count <= 20_000) == (tick.status != "bad_input")
        assert f"{count} points" in danger.message or count == 1_000
        if count <= 20_000:
            assert danger.cdf_n == pytest.approx(tick.cdf_n, rel=1e-9)
            assert len(danger.points) <= 1_000
        assert taken < 0.5


def test_parts_are_exchanged_with_the_checks_of_the_constructor() -> None:
    other, held = qpsafe.load_robot("irb14000"), DangerMonitor(ROBOT, DT)  # which owns an evasion
    wrong = {
        "field": (None, "x", 5, qpsafe.DangerField),
        "activation": (None, "x", qpsafe.Activation, qpsafe.Activation((qpsafe.Threshold(5.0, 0.1),))),
        "evasion": ("x", 5, qpsafe.Evasion(1.0, 1.0, 7), qpsafe.Evasion(1.0, 1.0, 6, dt=0.1), held.evasion),
        "limits": ("x", 5, qpsafe.JointLimits.of(ROBOT, 0.1), qpsafe.JointLimits.of(other, DT)),
        "ramp": (None, "x", np.nan, -1.0, np.inf, True, "0.1"),
    }
    settable = {name for name, kind in vars(DangerMonitor).items() if isinstance(kind, property) and kind.fset}
    assert settable == set(wrong)
    danger = DangerMonitor(ROBOT, DT)
    for key, values in wrong.items():
        for value in values:
            before = getattr(danger, key)
            with pytest.raises(qpsafe.ConfigurationError, match=key):
                setattr(danger, key, value)
            assert getattr(danger, key) is before
    for key in ("robot", "dt"):
        with pytest.raises(AttributeError):
            setattr(danger, key, getattr(danger, key))
    for key in settable:  # what is read may be set
        setattr(danger, key, getattr(danger, key))
    danger.update(ROBOT.home, REST, [near(ROBOT, ROBOT.home, 0.3)])
    assert danger.status == "ok"


def test_limits_see_the_parts_that_the_monitor_has_now(engine: Any, robot: Any) -> None:
    plugin, home = engine.plugin, engine.at(robot.home)
    danger = watch(robot, robot.home, [near(robot, robot.home, 0.4)], 0.3 * np.ones(6))
    limit = plugin.DangerLimit(danger, 9.0)
    danger.field = qpsafe.DangerField(static=2.0, kinetic=0.5)
    expected, found = plugin.DangerLimit(danger, 9.0).rows(home, DT), limit.rows(home, DT)
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1], expected[1])
    velocity = 3.0 * np.ones(6)
    np.testing.assert_array_equal(limit.guard(home, velocity), plugin.DangerLimit(danger, 9.0).guard(home, velocity))
    danger.limits = "robot"
    box = plugin.JointLimit(danger)
    danger.update(robot.home, REST, [])
    assert box.rows(home, DT)[1].shape == (12,)
    danger.limits = "off"
    danger.update(robot.home, REST, [])
    with pytest.raises(qpsafe.ConfigurationError, match="limits"):
        box.rows(home, DT)


@pytest.mark.parametrize("bad", [(np.nan * REST, np.nan * REST), (np.nan * REST, None)])
def test_a_monitor_that_is_reset_in_motion_brakes_within_the_acceleration_limits(bad: Any) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        danger, qd = DangerMonitor(ROBOT, DT), rng.uniform(-1.0, 1.0, 6) * ROBOT.max_velocity
        danger.update(ROBOT.home, qd, [])
        lower, upper = danger.box.lower, danger.box.upper
        danger.reset()
        last = rng.uniform(lower, upper)  # what it was sent
        danger.update(bad[0], last if bad[1] is None else bad[1], [])
        most = ROBOT.max_acceleration * DT
        assert np.all(np.abs(danger.box.lower - last) <= most + 1e-9)
        assert np.all(np.abs(danger.box.upper - last) <= most + 1e-9)
