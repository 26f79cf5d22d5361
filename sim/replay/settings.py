"""An experiment's settings as plain data, and the experiment again from them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from qpsafe.controller import SafetyController
from qpsafe.errors import ConfigurationError
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.problem import Law
from qpsafe.laws.weighted import WeightedLaw
from qpsafe.recovery.recovery import RecoveryRules
from qpsafe.robot.loader import bundled_robots, find_robot, load_robot
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.experiments.pick_place.pick_loop import PickLoop
from qpsafe.sim.people.choreography import Approach, Choreography
from qpsafe.sim.people.person import Board, Person
from qpsafe.sim.replay.settings_parts import part_settings, parts_of
from qpsafe.sim.replay.settings_pick import KIND, pick_of, pick_settings
from qpsafe.sim.stories.steps import StoryTable
from qpsafe.sim.stories.story import StepProblem, Story

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Experiment = FixedExperiment | PickPlaceExperiment
PLAIN = ("seed", "lag", "limits", "duration", "sensor", "cap")


def settings_of(experiment: Experiment) -> dict[str, Any]:
    """Everything that defines a run, for JSON.

    Raises:
        ConfigurationError: Law, tasks, thresholds or evasion are of the user's own making, or the body differs from
            the paper's person: replay could not build it again.
    """
    kind = {FixedExperiment: "fixed", PathExperiment: "path", PickPlaceExperiment: KIND}.get(type(experiment))
    if kind is None:
        raise ConfigurationError(
            "settings_of", "experiment", type(experiment).__name__, "one of the demos' experiments"
        )
    robot, story = experiment.robot, experiment.story
    found: dict[str, Any] = {
        "robot": _found_by(robot),
        "parameters": robot.parameters,
        "spots": _spots(robot),
        "law": law_settings(experiment.law),
        "rules": None if experiment.rules is None else asdict(experiment.rules),
        "recovery": None if experiment.recovery is None else asdict(experiment.recovery),
        **part_settings(experiment),
    }
    if isinstance(experiment, PickPlaceExperiment):
        return found | pick_settings(experiment)
    found |= {name: getattr(experiment, name) for name in PLAIN} | {
        "kind": kind,
        "asked_parameters": experiment.parameters,
        "story": None if story is None else {"floor": story.floor, **story.table.model_dump(mode="json")},
        "choreography": _choreography(experiment.choreography) if story is None else None,
        "cell": [[obstacle.name, obstacle.vertices.tolist()] for obstacle in experiment.cell],
    }
    if isinstance(experiment, PathExperiment):
        found["program"] = experiment.program_text
    return found


def experiment_of(settings: Mapping[str, Any]) -> Experiment:
    """The experiment that settings describe.

    Raises:
        ConfigurationError: They do not describe one.
    """
    try:
        robot = load_robot(settings["robot"]).with_parameters(settings.get("parameters", "robot"))
        if settings.get("spots") is not None:
            robot = robot.with_spots(settings["spots"])
        options: dict[str, Any] = {"law": law_of(settings["law"])}
        for name, make in (("rules", SensingRules), ("recovery", RecoveryRules)):
            options[name] = None if settings[name] is None else make(**settings[name])
        options |= parts_of(robot, settings)
        if settings["kind"] == KIND:
            return pick_of(robot, settings, options)
        options |= {name: settings[name] for name in PLAIN}
        furniture = settings.get("cell", ())  # older runs had none
        options["cell"] = tuple(Obstacle(name, np.array(vertices)) for name, vertices in furniture)
        options["parameters"] = settings.get("asked_parameters")  # older runs had the default
        if settings["story"] is not None:
            options["story"] = _story_of(settings["story"])
        else:
            options["choreography"] = _choreography_of(settings["choreography"])
        if settings["kind"] == "fixed":
            return FixedExperiment(robot, **options)
        if settings["kind"] == "path":
            return _with_program(settings["program"], lambda path: PathExperiment(robot, program=path, **options))
    except (KeyError, TypeError, AttributeError) as problem:
        raise ConfigurationError("the recorded settings", str(problem), None, "a complete set") from None
    raise ConfigurationError("the recorded settings", "kind", settings["kind"], f"fixed, path or {KIND}")


def _found_by(robot: Robot) -> str:
    """What `load_robot` finds the robot by: a bundled name, its folder, or its model file."""
    if robot.name in bundled_robots() and find_robot(robot.name).parent.samefile(robot.folder):
        return robot.name  # not of a copy that has kept the name
    return str((robot.folder if (robot.folder / "robot.toml").is_file() else robot.model_path).resolve())


def _spots(robot: Robot) -> str | None:
    """The file of the robot's sensors: its name in the robot's folder, or its path."""
    path = robot.spots_path
    return None if path is None else path.name if path.parent == robot.folder else str(path.resolve())


def loop_of(experiment: Experiment) -> FixedLoop | PickLoop:
    """What a run of the experiment starts with."""
    return PickLoop(experiment) if isinstance(experiment, PickPlaceExperiment) else FixedLoop(experiment)


def controller_of(experiment: Experiment) -> SafetyController:
    """The controller that a run of the experiment starts with."""
    return loop_of(experiment).controller


def law_settings(law: Law | None) -> dict[str, Any] | None:
    """Name and options of a bundled law; None for the controller's default."""
    if law is None:
        return None
    if isinstance(law, HierarchicalLaw):
        keys = "projection", "solver", "damping", "damping_time"
        return {"name": "hierarchical", **{key: getattr(law, key) for key in keys}}
    if isinstance(law, NullspaceLaw):
        return {"name": "nullspace"}
    if isinstance(law, WeightedLaw):
        return {"name": "weighted", "ratio": law.ratio, "solver": law.solver}
    raise ConfigurationError("settings_of", "law", type(law).__name__, "a bundled law: replay has to build it again")


def law_of(settings: Mapping[str, Any] | None) -> Law | None:
    """The law again."""
    if settings is None:
        return None
    if settings["name"] == "hierarchical":
        dampings = settings["damping"], settings.get("damping_time", 0.0)  # older runs knew one of them
        return HierarchicalLaw(settings["projection"], settings["solver"], *dampings)
    if settings["name"] == "weighted":
        return WeightedLaw(settings["ratio"], solver=settings["solver"])
    if settings["name"] == "nullspace":
        return NullspaceLaw()
    raise ConfigurationError("the recorded settings", "law.name", settings["name"], "hierarchical, weighted, nullspace")


def _choreography(choreography: Choreography) -> dict[str, Any]:
    if choreography.person.body != Person().body:
        raise ConfigurationError("settings_of", "choreography.person.body", None, "the body of the paper's person")
    found = asdict(choreography)
    del found["person"]["body"]
    return found


def _choreography_of(settings: Mapping[str, Any]) -> Choreography:
    person = settings["person"]
    return Choreography(
        **{k: v for k, v in settings.items() if k not in ("person", "approaches")},
        approaches=tuple(Approach(**approach) for approach in settings["approaches"]),
        person=Person(person["floor"], Board(*person["board"])),
    )


def _story_of(settings: Mapping[str, Any]) -> Story:
    try:
        table = StoryTable.model_validate({k: v for k, v in settings.items() if k != "floor"})
        return Story(table, floor=settings["floor"])
    except (ValidationError, StepProblem) as problem:
        raise ConfigurationError(
            "the recorded settings", "story", str(problem), "a story that can be planned"
        ) from None


def _with_program(text: str, make: Callable[[Path], PathExperiment]) -> PathExperiment:
    """An experiment whose program is read from its recorded text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recorded-program.toml"
        path.write_text(text, encoding="utf-8")
        experiment = make(path)
        experiment.reference, experiment.program_text  # noqa: B018  read them while the file is there
    return experiment
