"""Somebody walks straight at the robot, faster and faster: contact or not, experiment by experiment."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpsafe.sim.drawing.plots import STYLE
from qpsafe.sim.experiments.encounter import Encounter, encounter, to_moving_links
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.fixed.stage import robot_stage
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.experiments.pick_place.for_robot import work_for
from qpsafe.sim.recording.log import RunLog
from qpsafe.sim.replay.settings import Experiment
from qpsafe.sim.stories.file import parse_story
from qpsafe.sim.stories.story import Story
from qpsafe.text.figure_file import save

if TYPE_CHECKING:
    from qpsafe.laws.problem import Law
    from qpsafe.robot.robot import Robot

#: The bundled story: 2.0 m/s up to the pedestal's foot.
STORY = Path(__file__).with_name("fast-person.toml")
SPEEDS = (0.5, 1.0, 1.6, 2.0, 2.5)
EXPERIMENTS = ("fixed", "path", "pick-and-place")


@dataclass(frozen=True)
class FastRun:
    """One run.

    Attributes:
        experiment: Which.
        speed: How fast somebody walked [m/s].
        encounter: How it ended.
        moving_links: Smallest true distance of the links that move [m]; the base is bolted down.
        built: The experiment.
        log: Of the run.
    """

    experiment: str
    speed: float
    encounter: Encounter
    moving_links: float
    built: Experiment
    log: RunLog

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        known = {"experiment": self.experiment, "speed": self.speed, "moving_links": self.moving_links}
        return known | self.encounter.to_dict()


def at_speed(speed: float, floor: float = -0.55) -> Story:
    """The bundled story at another walking speed [m/s], to the end of the time that they stand at the pedestal.

    The floor is where the robot's pedestal stands [m].
    """
    text = STORY.read_text(encoding="utf-8").replace("speed = 2.0", f"speed = {speed!r}", 1)
    story = parse_story(text, STORY, floor=floor)
    story.duration = story.people[0].steps[2].end
    return story


def runs(
    robot: Robot,
    law: Law | None = None,
    speeds: tuple[float, ...] = SPEEDS,
    names: tuple[str, ...] = EXPERIMENTS,
    lag: float = 0.0,
    sensor: str = "ideal",
    observer: Callable[[str, float, Experiment], Any] | None = None,
) -> Iterator[FastRun]:
    """Run every experiment at every speed.

    Args:
        robot: Of the experiments.
        law: Of the controller; None for its default.
        speeds: Of the person [m/s].
        names: Of the experiments, some of `EXPERIMENTS`.
        lag: Of the plant [s].
        sensor: `ideal` or `sharp`.
        observer: Called before every run with its name, speed and experiment; returns a context manager that gives the
            run's observer.
    """
    for name in names:
        for speed in speeds:
            built = experiment_with(name, at_speed(speed, -pedestal_of(name, robot)), robot, law, lag, sensor)
            log = _run(built, None if observer is None else observer(name, speed, built))
            yield FastRun(name, speed, encounter(log, built), to_moving_links(log, built), built, log)


def pedestal_of(name: str, robot: Robot) -> float:
    """How high the robot stands in an experiment of `EXPERIMENTS` [m]."""
    return robot_stage(robot).pedestal if name != "pick-and-place" else work_for(robot).pedestal


def experiment_with(
    name: str, story: Story, robot: Robot, law: Law | None = None, lag: float = 0.0, sensor: str = "ideal"
) -> Experiment:
    """An experiment of `EXPERIMENTS` with a story's people; in the third one they carry no screws.

    Args:
        name: A key of `EXPERIMENTS`.
        story: What the people do.
        robot: The robot.
        law: The control law; the experiment's own by default.
        lag: Of the plant's joints [s].
        sensor: `ideal` or `sharp`.
    """
    if name == "pick-and-place":
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / STORY.name
            path.write_text(story.text, encoding="utf-8")
            some = {"cycles": 1 + round(story.duration / 5.0), "limit": story.duration, "brought": (0,), "lag": lag}
            third = PickPlaceExperiment(robot, law, people_file=path, sensor=sensor, **some)  # type: ignore[arg-type]
            third.story  # noqa: B018  read it while it is there
        return third
    kind = PathExperiment if name == "path" else FixedExperiment
    return kind(robot, law, lag=lag, story=story, duration=story.duration, sensor=sensor)


def _run(experiment: Experiment, watched: Any) -> RunLog:
    with nullcontext() if watched is None else watched as observer:
        result = experiment.run(observer)
    return result if isinstance(result, RunLog) else result.log


def fast_figure(found: list[FastRun], path: Path) -> None:
    """Smallest distance and the robot's speed then, over the person's speed."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.4, 4.6), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True)
        marks = (("#0b5fa5", "o-"), ("#c0392b", "s--"), ("#2a8c3c", "^-."))
        for name, (colour, mark) in zip(dict.fromkeys(run.experiment for run in found), marks, strict=False):
            mine = sorted((run for run in found if run.experiment == name), key=lambda run: run.speed)
            speeds = [run.speed for run in mine]
            upper.plot(speeds, [1e3 * run.encounter.distance for run in mine], mark, color=colour, label=name)
            lower.plot(speeds, [run.encounter.robot_speed for run in mine], mark, color=colour, label=name)
        upper.axhline(0.0, color="black", linewidth=0.9)
        upper.set(ylabel="smallest distance\nrobot to person [mm]")
        lower.set(
            ylabel="robot's fastest point\nthen, or at contact [m/s]", xlabel="walking speed [m/s]", ylim=(0.0, None)
        )
        upper.legend(loc="lower left")  # where people are slow the robot is far away
        save(figure, path)
