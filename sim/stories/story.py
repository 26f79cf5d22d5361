"""A story: who is where at any time, planned from data.

The steps of a person follow one another. Walks and turns move the root, and footsteps follow it; reaching moves the
hands, while the root stands unless it begins early. Everything is a function of time alone, and the same file gives the
same poses.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.engine.tracks import PersonTracks
from qpsafe.sim.people.person import Person, PersonPose
from qpsafe.sim.stories.actor import Actor
from qpsafe.sim.stories.planning import StepProblem, Taken
from qpsafe.sim.stories.steps import PersonTable, StoryTable, WaitStep, WalkStep

__all__ = ["Actor", "StepProblem", "Story", "Taken"]


class Story:
    """People and what they do.

    Attributes:
        table: The checked file.
        text: The file's text, as it was read; a varied story keeps it.
        people: In the file's order; each has `name`, `pose(time)`, `root(time)`, `steps` and `events`.
        duration: As the file says, else when everybody has done their last step [s].
    """

    def __init__(self, table: StoryTable, text: str = "", floor: float = -0.55) -> None:
        """Plan it.

        Args:
            table: What is to happen.
            text: Where `table` was read from.
            floor: Height of the floor, world frame [m].

        Raises:
            StepProblem: A step cannot be done.
        """
        self.table, self.text, self.floor = table, text, floor
        for k, person in enumerate(table.person):
            if person.name in [other.name for other in table.person[:k]]:
                raise StepProblem(k, ["name"], person.name, "another name: there is one so called already")
        self.people = tuple(Actor(person, k, floor) for k, person in enumerate(table.person))
        self.duration = table.duration or max(max(actor.end for actor in self.people), 0.1)

    @property
    def persons(self) -> tuple[Person, ...]:
        """Kinematics of everybody, for `build_scene(robot, people=story.persons)`."""
        return tuple(actor.person for actor in self.people)

    def poses(self, time: float) -> tuple[PersonPose, ...]:
        """Everybody at a time [s], for `scene.place_people`."""
        return tuple(actor.pose(time) for actor in self.people)

    def track(self, times: NDArray[np.float64]) -> PersonTracks:
        """Everybody at evenly spaced times (T,) [s], as plain arrays."""
        poses = [actor.poses_at(times) for actor in self.people]
        segments = [segment for person in self.persons for segment in person.body.segments]
        boards = [(each.boards, person.board) for each, person in zip(poses, self.persons, strict=True)]
        placed = [(at, (b.thickness, b.width, b.height)) for at, b in boards if at is not None and b is not None]
        return PersonTracks(
            ends=np.concatenate([each.ends for each in poses], axis=1),
            radii=np.array([segment.radius for segment in segments]),
            boards=np.stack([at for at, _ in placed], axis=1) if placed else np.empty((len(times), 0, 4, 4)),
            half_sizes=0.5 * np.array([size for _, size in placed]).reshape(-1, 3),
            dt=float(times[-1] - times[0]) / max(len(times) - 1, 1),
            names=tuple(segment.name.removeprefix("left_").removeprefix("right_") for segment in segments),
        )

    @cached_property
    def events(self) -> tuple[tuple[float, str, str], ...]:
        """Time [s], person and name of every event, in order of time."""
        return tuple(sorted((time, actor.name, name) for actor in self.people for time, name in actor.events))

    #: A story has no approaches in the sense of the first experiment.
    windows: tuple[tuple[float, float], ...] = ()

    def varied(self, seed: int) -> Story:
        """The story as another day would see it.

        People set out up to 1 s later, wait up to 30 % longer or shorter, and walk up to 10 % slower.

        Args:
            seed: 0 is this story itself; the same seed gives the same one.
        """
        if seed == 0:
            return self
        rng = np.random.default_rng(seed)
        people = [_varied(person, rng) for person in self.table.person]
        return Story(self.table.model_copy(update={"person": people}), self.text, self.floor)


def _varied(person: PersonTable, rng: Any) -> PersonTable:
    steps: list[Any] = [WaitStep(do="wait", time=float(rng.uniform(0.0, 1.0)))]
    for _ in range(person.repeat):
        for step in person.step:
            change: dict[str, Any] = {}
            if isinstance(step, WaitStep) and step.time is not None:
                change["time"] = step.time * float(rng.uniform(0.7, 1.3))
            if isinstance(step, WalkStep):
                change["speed"] = max(step.speed * float(rng.uniform(0.9, 1.0)), 0.5)
            steps.append(step.model_copy(update=change))
    return person.model_copy(update={"step": steps, "repeat": 1})
