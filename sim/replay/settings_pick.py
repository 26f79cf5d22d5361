"""Settings of the third experiment as plain data, and the experiment again from them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from qpsafe.robot.robot import Robot
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment

KIND = "pick-and-place"
PLAIN = ("seed", "cycles", "lag", "limit", "sensor")


def pick_settings(experiment: PickPlaceExperiment) -> dict[str, Any]:
    """What only the third experiment has: plain numbers, and the texts of its files."""
    people = experiment.people_file
    return {name: getattr(experiment, name) for name in PLAIN} | {
        "kind": KIND,
        "brought": list(experiment.brought),
        "people": None if people is None or experiment.story is None else experiment.story.text,
        "program": experiment.program_text,
    }


def pick_of(robot: Robot, settings: Mapping[str, Any], options: Mapping[str, Any]) -> PickPlaceExperiment:
    """The experiment that settings describe; `options` are the law and the rules.

    Args:
        robot: The robot.
        settings: As the run file has them.
        options: The law and the rules.
    """
    with tempfile.TemporaryDirectory() as folder:
        program, people = Path(folder) / "recorded-program.toml", Path(folder) / "recorded-people.toml"
        program.write_text(settings["program"], encoding="utf-8")
        if settings["people"] is not None:
            people.write_text(settings["people"], encoding="utf-8")
        experiment = PickPlaceExperiment(
            robot,
            **{name: settings[name] for name in PLAIN},
            brought=tuple(settings["brought"]),
            people_file=None if settings["people"] is None else people,
            program=program,
            **options,
        )
        experiment.reference, experiment.program_text, experiment.story  # noqa: B018  read them while they are there
    return experiment
