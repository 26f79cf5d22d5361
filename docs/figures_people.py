"""Draw the figures about people: ``python docs/figures_people.py [NAME ...]`` writes docs/img/NAME.png."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import qpsafe
from qpsafe.sim.drawing.stories import plan_figure
from qpsafe.sim.experiments.fast_person import at_speed, fast_figure, runs
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.stories.file import load_story
from qpsafe.sim.world.scene import build_scene

ROOT = Path(__file__).resolve().parents[1]
IMG = ROOT / "docs" / "img"
STORY = ROOT / "examples" / "two_people.toml"


def stories_plan() -> None:
    """The example from above."""
    plan_figure(load_story(STORY), IMG / "stories-plan.png")


def stories_people() -> None:
    """Six moments of the example."""
    from PIL import Image, ImageDraw, ImageFont

    from qpsafe.sim.drawing.render import Camera

    story = load_story(STORY)
    scene = build_scene(qpsafe.load_robot("irb140"), people=story.persons)
    data, camera = scene.make_data(), Camera(scene, (640, 400))
    frames = []
    font = ImageFont.load_default(22)
    for time in (1.4, 4.6, 7.3, 8.6, 10.5, 13.5):
        scene.place_people(data, story.poses(time))
        picture = Image.fromarray(np.ascontiguousarray(camera.picture(data)))
        ImageDraw.Draw(picture).text((14, 366), f"{time:.1f} s", fill=(20, 20, 20), font=font)
        frames.append(np.asarray(picture))
    camera.close()
    sheet = np.vstack([np.hstack(frames[:3]), np.hstack(frames[3:])])
    Image.fromarray(sheet).resize((1440, 600)).save(IMG / "stories-people.png")


def fast_person() -> None:
    """How near somebody comes who walks straight at the robot."""
    fast_figure(list(runs(qpsafe.load_robot("irb140"))), IMG / "fast-person.png")


def fast_person_frames() -> None:
    """Six moments of the first experiment with somebody at 2.0 m/s."""
    import tempfile

    from PIL import Image

    from qpsafe.sim.drawing.film import Film

    robot, story = qpsafe.load_robot("irb140"), at_speed(2.0)
    experiment = FixedExperiment(robot, story=story, duration=4.04)
    spots, frames = qpsafe.load_spots(robot), []
    assert spots is not None
    with (
        tempfile.TemporaryDirectory() as folder,
        Film(Path(folder) / "film.mp4", experiment.scene, spots, qpsafe.Activation()) as film,
    ):
        experiment.run(lambda *state: frames.append(film.observe(*state)))
    shown = [frames[10 * round(t / 0.04)] for t in (2.0, 2.8, 3.04, 3.2, 3.36, 4.0)]
    sheet = np.vstack([np.hstack(shown[:3]), np.hstack(shown[3:])])
    Image.fromarray(sheet).resize((1440, 540)).save(IMG / "fast-person-frames.png")


FIGURES: dict[str, Callable[[], None]] = {
    "stories-plan": stories_plan,
    "stories-people": stories_people,
    "fast-person": fast_person,
    "fast-person-frames": fast_person_frames,
}

if __name__ == "__main__":
    for name in sys.argv[1:] or FIGURES:
        FIGURES[name]()
