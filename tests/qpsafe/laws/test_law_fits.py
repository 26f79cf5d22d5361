"""A law that could answer no tick is refused where it is given, and nothing has changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import qpsafe

COUNTS = (1, 2, 3, 4)


def tasks(robot: Any, count: int) -> list[Any]:
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    every = [
        qpsafe.PositionTask("tcp", here),
        qpsafe.OrientationTask("tcp", here),
        qpsafe.PostureTask(robot.home),
        qpsafe.PostureTask(robot.home + 0.1),
    ]
    return every[:count]


def controller(robot: Any, count: int, law: Any = None) -> qpsafe.SafetyController:
    return qpsafe.SafetyController(robot, tasks(robot, count), law, activation=thresholds(count))


def thresholds(count: int) -> qpsafe.Activation:
    return qpsafe.Activation((qpsafe.Threshold(11.5, 0.15),) * count)


def status(run: qpsafe.SafetyController) -> str:
    return run.step(run.robot.home, np.zeros(run.robot.nq), points=[]).status


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("weights", range(1, 7))
def test_weights_are_taken_exactly_where_there_is_one_for_every_task_and_the_evasion(
    irb140: Any, count: int, weights: int
) -> None:
    law = qpsafe.WeightedLaw(weights=tuple(10.0**k for k in range(weights, 0, -1)))
    running = controller(irb140, count)
    assert status(running) == "ok"
    before = running.law
    if weights == count + 1:
        assert status(controller(irb140, count, law)) == "ok"
        running.law = law
    else:
        with pytest.raises(qpsafe.ConfigurationError, match=f"weights.*{count + 1} of them"):
            controller(irb140, count, law)
        with pytest.raises(qpsafe.ConfigurationError, match=f"weights.*{count + 1} of them"):
            running.law = law
        assert running.law is before
    assert status(running) == "ok"


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("other", COUNTS)
def test_tasks_are_exchanged_under_weights_exactly_where_their_number_stays(
    irb140: Any, count: int, other: int
) -> None:
    running = controller(irb140, count, qpsafe.WeightedLaw(weights=(1.0,) * (count + 1)))
    before = running.tasks
    if other == count:
        running.set_tasks(tasks(irb140, other), thresholds(other))
    else:
        with pytest.raises(qpsafe.ConfigurationError, match=f"weights.*{other + 1} of them"):
            running.set_tasks(tasks(irb140, other), thresholds(other))
        assert running.tasks is before
        assert status(running) == "ok"
        running.law = qpsafe.WeightedLaw()  # the way round
        running.set_tasks(tasks(irb140, other), thresholds(other))
        running.law = qpsafe.WeightedLaw(weights=(1.0,) * (other + 1))
    assert status(running) == "ok"


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("power", [3, 20, 40, 60, 99])
def test_a_ratio_is_taken_where_its_powers_can_be_computed_with(irb140: Any, count: int, power: int) -> None:
    law = qpsafe.WeightedLaw(10.0**power)
    if power * count <= 100:
        assert status(controller(irb140, count, law)) != "fault"
    else:
        with pytest.raises(qpsafe.ConfigurationError, match="ratio"):
            controller(irb140, count, law)


@pytest.mark.parametrize("law", [qpsafe.HierarchicalLaw, qpsafe.WeightedLaw])
@pytest.mark.parametrize("solver", ["nonsense", "", "qpsolvers:nonsense", "qpsolvers", "Own", 3.0, True, ["own"]])
def test_a_solver_that_there_is_not_is_refused_with_those_that_there_are(law: Any, solver: Any) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match=f'{law.__name__}: solver.*"own", "daqp", "proxqp"'):
        law(solver=solver)


@pytest.mark.parametrize("key", ["name", "frames", "essential"])
def test_a_task_that_a_controller_has_keeps_its_label(irb140: Any, key: str) -> None:
    for task in tasks(irb140, 4):
        running = qpsafe.SafetyController(irb140, [task])
        label = task.label
        with pytest.raises(qpsafe.ConfigurationError, match=key):
            setattr(task, key, "renamed")
        tick = running.step(irb140.home, np.zeros(6), points=[])
        assert tick.task_names == (label,) == (task.label,)


def test_a_task_of_ones_own_may_be_named_where_it_is_made(irb140: Any) -> None:
    class Own(qpsafe.PositionTask):
        def __init__(self, trajectory: Any) -> None:
            super().__init__("tcp", trajectory)
            self.name = "reach"

    task = Own(qpsafe.FixedPose(irb140.pose("tcp", irb140.home)))
    assert task.label == "reach of tcp"
    with pytest.raises(qpsafe.ConfigurationError, match="name"):
        task.name = "renamed"
