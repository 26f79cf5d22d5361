"""The first experiment on every bundled robot."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import qpsafe
from qpsafe.errors import RobotFileError
from qpsafe.robot.loader import bundled_robots
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.fixed.stage import CLOSE_GAP, MEDIUM_GAP, robot_stage
from qpsafe.sim.experiments.fixed.table import robot_row
from qpsafe.sim.experiments.shared.report import summarise
from qpsafe.sim.people.choreography import Choreography

pytestmark = pytest.mark.long

ROBOTS = {name: qpsafe.load_robot(name) for name in bundled_robots()}


@pytest.mark.parametrize("name", ROBOTS)
def test_the_stage_suits_the_robot(name: str) -> None:
    """The person stands on the floor below the pedestal and never reaches into the resting robot's wire."""
    robot = ROBOTS[name]
    found = robot_stage(robot)
    assert found.choreography.person.floor == -found.pedestal
    wire = robot.wire(robot.home, np.zeros(robot.nq))
    ends = np.vstack([wire.starts, wire.ends])
    for approach in found.choreography.approaches:
        towards = np.array([np.cos(approach.azimuth), np.sin(approach.azimuth), 0.0])
        reach = float((ends @ towards).max())
        assert 0.2 < approach.close_distance - reach < approach.medium_distance - reach < 0.8
    assert FixedExperiment(robot).scene.pedestal == found.pedestal


def test_the_irb_140_s_stage_is_the_first_experiment_as_it_was() -> None:
    assert robot_stage(ROBOTS["irb140"]).choreography == Choreography()


def test_another_robot_gets_its_stage_by_the_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = qpsafe.load_robot("irb140")
    monkeypatch.setitem(robot.__dict__, "name", "somebody's own")
    front = robot_stage(robot).choreography.approaches[0]
    tip = robot.pose("tcp", robot.home)[0, 3]
    assert front.medium_distance == pytest.approx(tip + MEDIUM_GAP)
    assert front.close_distance == pytest.approx(tip + CLOSE_GAP)


@pytest.mark.parametrize("name", ROBOTS)
def test_every_tool_is_kept_and_logged(name: str) -> None:
    """Nobody near: all tools stay; errors of all tools are in the log, one after the other."""
    robot = ROBOTS[name]
    log = FixedExperiment(robot, duration=0.1).run()
    assert log.position_error.shape == log.measured_orientation_error.shape == (25, 3 * len(robot.tool_frames))
    assert np.abs(log.position_error).max() < 1e-4
    assert set(log.status) == {"ok"}
    assert log.q.shape == (25, robot.nq)


def test_a_robot_without_spots_is_refused() -> None:
    with pytest.warns(qpsafe.errors.RobotWarning):
        bare = qpsafe.load_robot(ROBOTS["iiwa14"].model_path)
    with pytest.raises(RobotFileError, match="spots"):
        FixedExperiment(bare)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in ROBOTS if name != "irb140"])  # that one has a test file of its own
def test_regimes_in_order_limits_held_distance_gained(name: str) -> None:
    experiment = FixedExperiment(ROBOTS[name])
    log = experiment.run()
    report = summarise(log, experiment.board_distance_without_controller(), experiment.windows(), ROBOTS[name])
    assert report.kept, [check for check in report.checks if not check.kept]
    row = robot_row(ROBOTS[name], report)
    assert row.in_order == (3, 3)
    assert row.limits_held
    assert min(row.gained) > 0.01
    level = {"low": 0, "medium": 1, "high": 2}
    assert {abs(level[b.name] - level[a.name]) for a, b in pairwise(log.intervals())} == {1}
    if name == "irb14000":  # both arms evaded
        moved = np.abs(log.q_ref - ROBOTS[name].home).max(axis=0)
        assert moved[:7].max() > 0.2
        assert moved[7:].max() > 0.2
