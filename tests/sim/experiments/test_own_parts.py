"""All experiments take tasks, thresholds, evasion and metrics of their user's."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.replay.settings import controller_of, experiment_of, settings_of

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")
EXPERIMENTS: dict[str, Callable[..., Any]] = {
    "fixed": lambda **own: FixedExperiment(ROBOT, duration=0.1, **own),
    "path": lambda **own: PathExperiment(ROBOT, duration=0.1, **own),
    "pick-and-place": lambda **own: PickPlaceExperiment(ROBOT, limit=0.1, cycles=1, people_file=None, **own),
}


def log_of(experiment: Any) -> Any:
    found = experiment.run()
    return getattr(found, "log", found)


@pytest.fixture(params=first(1, EXPERIMENTS))
def make(request: pytest.FixtureRequest) -> Callable[..., Any]:
    return EXPERIMENTS[request.param]


def test_the_parts_reach_the_controller(make: Callable[..., Any]) -> None:
    goal = qpsafe.FixedPose(ROBOT.pose("tcp", ROBOT.home))
    tasks = (qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal), qpsafe.PostureTask(ROBOT.home))
    thresholds = tuple(qpsafe.Threshold(delta, 0.1) for delta in (9.0, 6.0, 4.0))
    evasion = qpsafe.Evasion(2.0, 10.0, ROBOT.nq)
    evasion.velocity = np.ones(ROBOT.nq)
    own = make(tasks=tasks, activation=qpsafe.Activation(thresholds), evasion=evasion)
    first, second = controller_of(own), controller_of(own)
    assert first.tasks == tasks
    assert first.activation.thresholds == thresholds
    assert np.array_equal(first.evasion.mass, evasion.mass)
    assert first.evasion is not second.evasion  # runs do not share what it remembers
    assert not first.evasion.velocity.any()
    assert evasion.velocity.all()
    assert len(controller_of(make(tasks=tasks[2:])).tasks) == 1  # with the controller's own thresholds


def test_errors_in_the_log_are_of_the_tool_whatever_the_tasks(make: Callable[..., Any]) -> None:
    """The usual tasks, given by hand: the errors are those after the tick, not before it."""
    usual = make()
    same = log_of(make(tasks=controller_of(usual).tasks))
    log = log_of(usual)
    assert np.array_equal(same.q_ref, log.q_ref)
    for name in ("position_error", "orientation_error"):
        assert getattr(same, name)[:-1] == pytest.approx(getattr(log, name)[1:], abs=2e-3)
    away = qpsafe.PostureTask(ROBOT.home + 0.05)
    assert np.linalg.norm(log_of(make(tasks=[away])).position_error[-1]) > 1e-4


def test_metrics_are_written_down_and_change_nothing(make: Callable[..., Any], tmp_path: Path) -> None:
    metrics = {
        "twice": lambda tick, scene, plant: 2.0 * tick.reference.time,
        "joints": lambda tick, scene, plant: plant.q,
    }
    log, usual = log_of(make(metrics=metrics)), log_of(make())
    assert np.array_equal(log.q_ref, usual.q_ref)
    assert usual.metrics == {}
    assert np.array_equal(log.metrics["twice"], 2.0 * log.time)
    assert np.array_equal(log.metrics["joints"], log.q)
    log.write_csv(tmp_path / "signals.csv")
    with (tmp_path / "signals.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["joints_2"]) for row in rows] == pytest.approx(log.q[:, 1], rel=1e-8)
    assert [float(row["twice"]) for row in rows] == pytest.approx(2.0 * log.time, rel=1e-8)


def test_what_is_no_metric_is_refused(make: Callable[..., Any]) -> None:
    with pytest.raises(ConfigurationError, match="gap"):
        make(metrics={"gap": 3.0})


def test_thresholds_and_evasion_are_recorded_and_tasks_cannot_be(make: Callable[..., Any]) -> None:
    thresholds = (qpsafe.Threshold(9.0, 0.2), qpsafe.Threshold(5.0, 0.1))
    own = make(activation=qpsafe.Activation(thresholds), evasion=qpsafe.Evasion(np.arange(1.0, 7.0), 10.0, ROBOT.nq))
    found = json.loads(json.dumps(settings_of(own)))
    again = experiment_of(found)
    assert again.activation is not None
    assert again.activation.thresholds == thresholds
    assert again.evasion is not None
    assert [a.tolist() for a in again.evasion.matrices] == [a.tolist() for a in own.evasion.matrices]
    older = {key: value for key, value in found.items() if key not in ("thresholds", "evasion")}
    assert experiment_of(older).evasion is None
    with pytest.raises(ConfigurationError, match="tasks"):
        settings_of(make(tasks=[qpsafe.PostureTask(ROBOT.home)]))

    class Own(qpsafe.Evasion):
        pass

    with pytest.raises(ConfigurationError, match="Own"):
        settings_of(make(evasion=Own(4.0, 20.0, ROBOT.nq)))
