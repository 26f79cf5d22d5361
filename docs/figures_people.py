"""Draw the figures about people: ``python docs/figures_people.py [NAME ...]`` writes docs/img/NAME.png."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import qpsafe
from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.campaign.people.floor_plan import FloorPlan
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


def campaign_people() -> None:
    """Random encounters, one kind a row, about the moment when the person is nearest to the robot."""
    import mujoco
    from PIL import Image, ImageDraw, ImageFont

    model, robot = EncounterModel.load(), qpsafe.load_robot("irb140")
    x, y, z = (float(value) for value in robot.pose("tcp", robot.home)[:3, 3])
    plan = FloorPlan(-0.55, (x, y, z), 0.81)
    rows, font = [], ImageFont.load_default(20)
    for kind, seed in (("past", 1), ("straight", 3), ("backwards", 9), ("stumble", 0), ("reach", 8), ("turn", 38)):
        story = model.encounter(model.random(seed), plan)
        assert model.kinds(model.random(seed)) == (kind,)
        scene = build_scene(robot, people=story.persons)
        data = scene.make_data()
        times = np.arange(0.0, story.duration, 0.01)
        places = np.stack(story.people[0].course(times)[:2], axis=1)
        nearest = int(np.argmin(np.hypot(*places.T)))
        view = mujoco.MjvCamera()
        view.lookat[:], view.distance, view.elevation = (0.35, 0.0, 0.2), 5.0, -16.0
        view.azimuth = np.degrees(np.arctan2(places[nearest, 1], places[nearest, 0])) + 180.0 + 65.0
        renderer, frames = mujoco.Renderer(scene.model, 300, 300), []
        later = (-0.6, -0.3, 0.0, 0.3, 0.7, 1.3) if kind != "reach" else (-0.6, 0.0, 0.7, 1.2, 1.8, 2.5)
        for time in times[nearest] + np.array(later):
            scene.place_people(data, story.poses(float(time)))
            renderer.update_scene(data, view)
            picture = Image.fromarray(renderer.render())
            ImageDraw.Draw(picture).text((10, 270), f"{time:.1f} s", fill=(20, 20, 20), font=font)
            frames.append(np.asarray(picture))
        renderer.close()
        rows.append(np.hstack(frames))
    Image.fromarray(np.vstack(rows)).resize((1440, 1440)).save(IMG / "campaign-people.png", optimize=True)


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
    "campaign-people": campaign_people,
    "fast-person": fast_person,
    "fast-person-frames": fast_person_frames,
}

if __name__ == "__main__":
    for name in sys.argv[1:] or FIGURES:
        FIGURES[name]()
