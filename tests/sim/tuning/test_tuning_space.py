"""Every point is a controller that can be made, and the present values are one of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.activation import Activation, Threshold
from qpsafe.sim.tuning.robot_file import farthest
from qpsafe.sim.tuning.space import Dimension, Space
from qpsafe.sim.tuning.values import present

ROBOTS = ("irb140", "iiwa14", "irb14000")


@pytest.mark.parametrize("name", ROBOTS)
def test_the_present_values_are_those_of_a_default_controller(name: str) -> None:
    robot = qpsafe.load_robot(name)
    space, now = Space.of(robot), present(robot)
    assert space.at(space.start) == space.values == now
    frame = robot.tool_frames[0]
    here = qpsafe.FixedPose(robot.pose(frame, robot.home))
    usual = qpsafe.SafetyController(robot, [qpsafe.PositionTask(frame, here), qpsafe.OrientationTask(frame, here)])
    parts = now.parts(robot)
    assert parts["activation"].levels == usual.activation.levels
    np.testing.assert_allclose(parts["evasion"].mass, usual.evasion.mass, rtol=1e-12)
    np.testing.assert_allclose(parts["evasion"].damping, usual.evasion.damping, rtol=1e-12)
    assert parts["recovery"] == usual.recovery_rules
    assert parts["sensing"] == qpsafe.SensingRules()
    assert repr(parts["gate"]) == repr(usual.gate)
    for d in space.dimensions:
        assert d.low <= space.start[d.name] <= d.high
        assert d.low < d.high
        assert d.reason


SPACE = Space.of(qpsafe.load_robot("irb140"))


@settings(max_examples=some(10, of=60))
@given(st.lists(st.floats(0.0, 1.0), min_size=len(SPACE.dimensions), max_size=len(SPACE.dimensions)))
def test_every_point_can_be_made_and_rounding_changes_nothing_twice(shares: list[float]) -> None:
    point = {d.name: min(max(d.at(share), d.low), d.high) for d, share in zip(SPACE.dimensions, shares, strict=True)}
    found = SPACE.at(point)
    # raises where Table I would be impossible
    Activation((Threshold(found.delta, found.epsilon), Threshold(found.delta_f, found.epsilon_f)))
    assert found.rounded() == found
    found.parts(qpsafe.load_robot("irb140"))
    slow = found.mass[0] / found.damping[0] / (SPACE.values.mass[0] / SPACE.values.damping[0])
    assert slow == pytest.approx(point["delay_arm"], rel=2e-3)


@given(st.integers(0, 10_000), st.floats(0.0, 2.0))
def test_points_near_the_present_ones_are_within_bounds(seed: int, spread: float) -> None:
    point = SPACE.near(np.random.default_rng(seed), spread)
    for d in SPACE.dimensions:
        assert d.low * (1 - 1e-12) <= point[d.name] <= d.high * (1 + 1e-12)


@given(st.floats(0.0, 1.0), st.booleans())
def test_shares_of_a_way_come_back(share: float, log: bool) -> None:
    d = Dimension("x", 0.5, 8.0, log, "")
    assert d.share(d.at(share)) == pytest.approx(share, abs=1e-12)


def test_an_endless_sidestep_is_somebodys_decision_and_is_not_tuned(irb140: Any) -> None:
    strict = irb140.with_parameters("robot")
    other = qpsafe.load_robot("irb140")
    other.__dict__["tuned"] = strict.tuned._replace(gate=(("sidestep", float("inf")),))
    space = Space.of(other)
    assert "sidestep" not in space.start
    assert space.at(space.start | {"calm": 0.5}).sidestep == float("inf")


def test_the_difference_of_values_is_the_largest_of_all() -> None:
    now = SPACE.values
    assert farthest(now, now) == 0.0
    assert farthest(now, replace(now, mass=(2.0 * now.mass[0], *now.mass[1:]))) == pytest.approx(0.5)
