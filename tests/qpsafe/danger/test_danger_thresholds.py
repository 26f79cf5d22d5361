"""Thresholds of other robots: the paper's, carried over by a rule."""

from __future__ import annotations

import numpy as np
import pytest

import qpsafe
from qpsafe.danger.thresholds import REFERENCE_FIELD, SOURCE, reference_field, robot_activation, robot_thresholds
from qpsafe.robot.loader import bundled_robots, load_robot


def test_the_irb_140_keeps_the_source_s_thresholds() -> None:
    robot = load_robot("irb140")
    assert robot_thresholds(robot) == SOURCE
    assert reference_field(robot) == pytest.approx(REFERENCE_FIELD, abs=0.005)


@pytest.mark.parametrize("name", bundled_robots())
def test_what_the_files_state_is_what_the_rule_gives(name: str) -> None:
    robot = load_robot(name)
    factor = reference_field(robot) / REFERENCE_FIELD
    for stated, source in zip(robot_thresholds(robot), SOURCE, strict=True):
        assert stated.delta == pytest.approx(factor * source.delta, abs=0.03)
        assert stated.epsilon == source.epsilon


@pytest.mark.filterwarnings("ignore::qpsafe.errors.RobotWarning")
@pytest.mark.parametrize("name", bundled_robots())
def test_a_bare_model_gets_its_thresholds_by_the_rule(name: str) -> None:
    """The same robot without its robot.toml: another wire, so other numbers, but always a valid activation."""
    bare = load_robot(load_robot(name).model_path, max_velocity=1.0)
    assert bare.danger is None
    high, low = robot_thresholds(bare)
    assert high.delta / low.delta == pytest.approx(11.5 / 7.5, rel=1e-2)
    assert np.isfinite(reference_field(bare))
    assert len(robot_activation(bare, 2, 3).thresholds) == 5


def test_controllers_take_the_robot_s_thresholds() -> None:
    for name in bundled_robots():
        robot = load_robot(name)
        frame = robot.tool_frames[0]
        goal = qpsafe.FixedPose(robot.pose(frame, robot.home))
        tasks = [qpsafe.PositionTask(frame, goal), qpsafe.OrientationTask(frame, goal)]
        assert qpsafe.SafetyController(robot, tasks).activation.thresholds == robot_thresholds(robot)
        assert qpsafe.SafetyController(robot, tasks[:1]).activation.thresholds == robot_thresholds(robot)[:1]
