"""The first experiment with the parameters of a robot's file, as after tuning: they are used, recorded and replayed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from amounts import first
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sim.experiments.fast_person import STORY
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.replay.settings import controller_of, experiment_of, settings_of
from qpsafe.sim.stories.file import load_story
from qpsafe.sim.tuning.robot_file import write_folder
from qpsafe.sim.tuning.space import Space

pytestmark = pytest.mark.long


@pytest.mark.parametrize("name", first(1, ["irb140", "iiwa14"]))
@pytest.mark.parametrize("parameters", first(1, ["robot", "paper"]))
def test_parameters_are_those_that_were_asked_for(name: str, parameters: str, tmp_path: Path) -> None:
    space = Space.of(load_robot(name))
    values = space.at(space.near(np.random.default_rng(4), 0.3))
    robot = load_robot(write_folder(load_robot(name), values, "a run", tmp_path / "copy"))
    experiment = FixedExperiment(robot, duration=0.02, parameters=parameters)
    controller = controller_of(experiment)
    own = parameters == "robot"
    assert (controller.activation.levels[0].delta == values.delta) == own
    assert (controller.recovery_rules.calm == values.calm) == own
    mass, damping = controller.evasion.mass, controller.evasion.damping
    assert np.allclose(np.diag(mass), values.mass) == own
    assert np.allclose(np.diag(damping), values.damping) == own
    again = experiment_of(json.loads(json.dumps(settings_of(experiment))))
    assert again.parameters == parameters
    np.testing.assert_array_equal(again.run().q_ref, experiment.run().q_ref)


@pytest.mark.parametrize("loaded", first(1, ["paper", "robot"]))
@pytest.mark.parametrize("parameters", first(1, [None, "paper", "robot"]))
def test_a_story_has_the_robots_own_unless_they_are_asked_for(parameters: str | None, loaded: str) -> None:
    robot = load_robot("irb140", parameters=loaded)
    experiment = FixedExperiment(robot, duration=0.02, story=load_story(STORY), parameters=parameters)
    paper = parameters == "paper"
    assert (controller_of(experiment).evasion.mass[0, 0] == 4.0) == paper
    again = experiment_of(json.loads(json.dumps(settings_of(experiment))))
    np.testing.assert_array_equal(again.run().q_ref, experiment.run().q_ref)
    assert np.array_equal(controller_of(again).evasion.mass, controller_of(experiment).evasion.mass)


def test_what_is_neither_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["demo", "fixed", "--parameters", "mine", "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, ConfigurationError)
    assert "paper or robot" in str(result.exception)
    assert not (tmp_path / "out").exists()
