"""What a robot's file may state of its controllers, and the paper's parameters beside it."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import qpsafe
from qpsafe.danger.evasion import Evasion, friction_of
from qpsafe.danger.thresholds import SOURCE, robot_thresholds
from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.gate.rules import VerifiedMotion

EVASION = "[evasion]\nmass = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\ndamping = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\n"
TABLES = """
[evasion]
mass = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
damping = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]

[recovery]
angular_speed = 90.0
calm = 0.5
dwell = 0.0

[sensing]
hold_time = 0.3

[gate]
approach = 0.02
escape = 0.1
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The IRB 140 with parameters of its own."""
    found = tmp_path / "own"
    shutil.copytree(qpsafe.load_robot("irb140").folder, found)
    return with_tables(found, TABLES)


def with_tables(folder: Path, tables: str) -> Path:
    file = folder / "robot.toml"
    text = file.read_text(encoding="utf-8").replace("delta = 11.5", "delta = 12.5")
    file.write_text(text + tables, encoding="utf-8")
    return folder


def controller(robot: qpsafe.Robot, **parts: object) -> qpsafe.SafetyController:
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    return qpsafe.SafetyController(robot, tasks, **parts)  # type: ignore[arg-type]


def test_controllers_have_what_the_file_states_and_the_rest_by_default(folder: Path) -> None:
    made = controller(qpsafe.load_robot(folder))
    assert made.activation.levels[0] == qpsafe.Threshold(12.5, 0.15)
    assert made.evasion.mass.diagonal().tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert made.evasion.damping.diagonal().tolist() == [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]
    assert made.recovery_rules == qpsafe.RecoveryRules(angular_speed=np.pi / 180.0 * 90.0, calm=0.5, dwell=0.0)
    assert made.sensing is not None
    assert made.sensing.rules.hold_time == 0.3
    assert made.gate is not None
    assert (made.gate.approach, made.gate.sidestep, made.gate.escape) == (0.02, VerifiedMotion().sidestep, 0.1)


def test_what_is_given_to_a_controller_counts_more(folder: Path) -> None:
    made = controller(
        qpsafe.load_robot(folder), evasion="paper", recovery=qpsafe.RecoveryRules(), gate=VerifiedMotion()
    )
    assert made.evasion.damping[0, 0] == 20.0
    assert made.recovery_rules == qpsafe.RecoveryRules()
    assert made.gate is not None
    assert made.gate.approach == 0.05


@pytest.mark.parametrize("name", ["irb140", "iiwa14", "irb14000"])
def test_the_sources_thresholds_are_the_bundled_robots_own_by_the_rule(name: str) -> None:
    paper = qpsafe.load_robot(name, parameters="paper")
    assert paper.danger is None
    assert robot_thresholds(paper) == robot_thresholds(qpsafe.load_robot(name))
    if name == "irb140":
        assert robot_thresholds(paper) == SOURCE


def test_with_the_papers_parameters_a_file_states_none(folder: Path) -> None:
    tuned, plain = qpsafe.load_robot(folder), qpsafe.load_robot("irb140")
    for made in (controller(qpsafe.load_robot(folder, parameters="paper")), controller(tuned, parameters="paper")):
        usual = controller(plain)
        assert made.activation.levels == SOURCE
        np.testing.assert_array_equal(made.evasion.mass, Evasion.for_robot(plain, 0.004).mass)
        assert made.recovery_rules == usual.recovery_rules
        assert repr(made.gate) == repr(usual.gate)
    with pytest.raises(ConfigurationError, match=r"parameters.*'source'"):
        qpsafe.load_robot("irb140", parameters="source")


def test_joints_in_another_order_have_their_own_values(folder: Path) -> None:
    file = folder / "robot.toml"
    text = file.read_text(encoding="utf-8")
    first, second = text.index("[joints.joint_1]"), text.index("[joints.joint_2]")
    third = text.index("[joints.joint_3]")
    text = text[:first] + text[second:third] + text[first:second] + text[third:]
    file.write_text(text.replace("home = [0.0, -5.0,", "home = [-5.0, 0.0,"), encoding="utf-8")
    assert controller(qpsafe.load_robot(folder)).evasion.mass.diagonal().tolist() == [2.0, 1.0, 3.0, 4.0, 5.0, 6.0]


def test_friction_is_that_of_the_file_in_its_order_or_that_of_the_rule(folder: Path) -> None:
    """None is a friction, too; what is left out follows the thresholds that the file states."""
    file = folder / "robot.toml"
    text = file.read_text(encoding="utf-8")
    robot = qpsafe.load_robot(folder)
    np.testing.assert_array_equal(controller(robot).evasion.friction, friction_of(robot, qpsafe.Threshold(12.5, 0.15)))
    for stated in ([0.5, 1.0, 0.0, 2.0, 3.0, 4.0], [0.0] * 6):
        file.write_text(text.replace("[evasion]\n", f"[evasion]\nfriction = {stated}\n"), encoding="utf-8")
        made = controller(qpsafe.load_robot(folder)).evasion
        assert made.friction.tolist() == stated
        assert made.mass.diagonal().tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    paper = controller(qpsafe.load_robot(folder), evasion="paper")
    assert not paper.evasion.friction.any()


@pytest.mark.parametrize(
    ("tables", "named"),
    [
        (EVASION + "friction = [1.0]\n", r"evasion.friction.*6 values"),
        (EVASION + "friction = [1.0, 1.0, 1.0, 1.0, 1.0, -1.0]\n", r"evasion.friction"),
        ("[evasion]\nmass = [1.0]\ndamping = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\n", r"evasion.mass.*6 values"),
        ("[evasion]\nmass = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\n", r"evasion.damping.*missing"),
        ("[recovery]\ncalm = 1.5\n", r"recovery.calm.*1.5"),
        ("[recovery]\nhelp = 1.5\n", r"recovery.help.*no such key"),
        ("[sensing]\nhold_time = -1.0\n", r"sensing.hold_time"),
        ("[gate]\nperson_speed = 1.0\n", r"gate.person_speed.*no such key"),  # what is assumed of people is not tuned
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, tables: str, named: str) -> None:
    shutil.copytree(qpsafe.load_robot("irb140").folder, tmp_path / "own")
    with pytest.raises(RobotFileError, match=named):
        qpsafe.load_robot(with_tables(tmp_path / "own", "\n" + tables))


def test_what_reproduces_the_source_uses_its_thresholds(folder: Path) -> None:
    from qpsafe.sim.campaign.opponents import opponent
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.sim.experiments.fixed.experiment import FixedExperiment

    tuned = qpsafe.load_robot(folder)
    assert robot_thresholds(FixedExperiment(tuned).robot) == SOURCE
    place = Station("hold", tuned)
    for name in ("strict", "paper", "nullspace", "weighted"):
        made = opponent(name).make(place)
        assert made.activation.levels == SOURCE  # type: ignore[attr-defined]
    usual = opponent("default").make(place)
    assert usual.activation.levels[0].delta == 12.5  # type: ignore[attr-defined]


def test_a_recorded_run_remembers_whose_parameters_it_had(folder: Path) -> None:
    from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
    from qpsafe.sim.replay.settings import experiment_of, settings_of
    from qpsafe.sim.stories.file import load_story

    story = load_story("examples/two_people.toml", floor=-0.8)
    for parameters, delta in (("robot", 12.5), ("paper", 11.5)):
        robot = qpsafe.load_robot(folder, parameters=parameters)
        again = experiment_of(settings_of(FixedExperiment(robot, story=story, duration=1.0)))
        assert again.robot.parameters == parameters
        assert robot_thresholds(again.robot)[0].delta == delta
