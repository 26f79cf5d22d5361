"""The experiments by name, as loops that can be run here or over the wire."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Any

from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.experiments.pick_place.pick_loop import PickLoop

if TYPE_CHECKING:
    from qpsafe.laws.problem import Law
    from qpsafe.robot.robot import Robot


class ExperimentName(StrEnum):
    """Experiments that can be run over the wire."""

    fixed = "fixed"
    path = "path"
    pick_and_place = "pick-and-place"


def experiment_loop(
    name: str, robot: Robot, law: Law | None = None, seed: int = 0, sensor: str = "ideal"
) -> tuple[Any, float]:
    """A loop with `controller`, `plant`, `scene`, `step` and `advance`, and how long the experiment takes [s].

    Args:
        name: A value of `ExperimentName`.
        robot: The robot.
        law: The control law; the controller's default if None.
        seed: Of what is random.
        sensor: ``ideal`` or ``sharp``.
    """
    if name == ExperimentName.pick_and_place:
        third = PickPlaceExperiment(robot, law, seed=seed, sensor=sensor)
        return PickLoop(third), third.duration
    kind = {ExperimentName.fixed: FixedExperiment, ExperimentName.path: PathExperiment}[ExperimentName(name)]
    experiment = kind(robot, law, seed=seed, sensor=sensor)
    return FixedLoop(experiment), experiment.duration
