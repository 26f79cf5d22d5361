"""Moving pictures for the site, one HTML file each, to be turned with the mouse: python docs/recordings.py FOLDER.

A file holds viser's page and about a megabyte of motion, so it is made and not committed.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import qpsafe
from qpsafe.sensing.skin.spots import load_spots
from qpsafe.sim.drawing.film import medium_and_high
from qpsafe.sim.experiments.fast_person import at_speed, experiment_with
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.replay.settings import Experiment
from qpsafe.sim.web.bodies import Bodies
from qpsafe.sim.web.danger import Danger
from qpsafe.sim.web.server import Page
from qpsafe.sim.web.view import EYE, LOOK

EVERY = 25  # ticks: ten pictures a second
#: The frame on a page is smaller than the page of `qpsafe web`: nearer than there [m].
NEAR = tuple(at + 0.7 * (eye - at) for eye, at in zip(EYE, LOOK, strict=True))


def experiments() -> dict[str, Experiment]:
    """What is recorded, by the name of its file."""
    robot = qpsafe.load_robot("irb140")
    return {
        "first-experiment": FixedExperiment(robot, duration=15.0),  # the first approach and the way back
        "second-experiment": PathExperiment(robot, duration=20.0),
        "third-experiment": PickPlaceExperiment(robot, limit=32.0),  # until Ada has taken a screw
        "fast-person": experiment_with("fixed", at_speed(2.0), robot),
    }


def recorded(experiment: Experiment) -> str:
    """A run: rays, points, danger vectors, links coloured by danger."""
    robot = experiment.robot
    page = Page("127.0.0.1", 0, "an experiment")
    try:
        server = page.server
        server.initial_camera.position, server.initial_camera.look_at = NEAR, LOOK
        bodies = Bodies(server, experiment.scene)
        thresholds = medium_and_high(qpsafe.robot_activation(robot))
        danger = Danger(server, experiment.scene, load_spots(robot), bodies, thresholds)
        frames = server.get_scene_serializer()

        def watch(tick: Any, scene: Any, plant: Any) -> None:
            if tick.reference.seq % EVERY == 0:
                bodies.show(plant.data)
                danger.show(tick, plant.q)
                frames.insert_sleep(EVERY * 0.004)

        experiment.run(watch)
        return frames.as_html()
    finally:
        page.close()


def write(name: str, folder: Path) -> None:
    """Record one of the experiments into a file."""
    (folder / f"{name}.html").write_text(recorded(experiments()[name]), encoding="utf-8")


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor() as processes:  # compiled by now
        for _ in processes.map(partial(write, folder=folder), experiments()):
            pass
