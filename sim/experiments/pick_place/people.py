"""The third experiment's people, and how they vary from day to day."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from qpsafe.sim.experiments.pick_place.cell import Cell
from qpsafe.sim.experiments.pick_place.for_robot import HANDS
from qpsafe.sim.stories.file import load_story, parse_story
from qpsafe.sim.stories.steps import PersonTable, ReachStep, WalkStep
from qpsafe.sim.stories.story import Story
from qpsafe.sim.stories.write import story_text

STAND, REACH = 0.04, 0.02  # how far people stand and reach from where the file says, to each side [m]


def load_people(path: Path, seed: int = 0, floor: float = -0.55, cell: Cell | None = None) -> Story:
    """A story as another day would see it: other times and speeds (`Story.varied`), other places.

    Args:
        path: The TOML file.
        seed: 0 is the story itself; the same seed gives the same one.
        floor: Where they stand, in the robot's frame [m].
        cell: Where the support and the box are that people come for; as the file has it if None.
    """
    story = load_story(path, floor=floor if cell is None else Cell().top - HANDS)
    if cell is not None and cell.support != Cell().support:
        moved = [_moved(person, cell) for person in story.table.person]
        story = parse_story(story_text(story.table.model_copy(update={"person": moved})), path, floor=floor)
    if seed == 0:
        return story
    rng = np.random.default_rng([seed, 14])
    people = [_elsewhere(person, rng) for person in story.varied(seed).table.person]
    return Story(story.table.model_copy(update={"person": people}), story.text, story.floor)


def _moved(person: PersonTable, cell: Cell) -> PersonTable:
    """Somebody who comes for the support, or for the box, where it is now."""
    usual, left = Cell(), person.start[1] > 0.0
    now, then = (cell.support, usual.support) if left else (cell.box, usual.box)
    dx, dy, dz = now.centre[0] - then.centre[0], now.centre[1] - then.centre[1], cell.top - usual.top
    steps: list[Any] = []
    for step in person.step:
        if isinstance(step, WalkStep):
            points = [step.to] if isinstance(step.to, tuple) else list(step.to)
            step = step.model_copy(update={"to": [(x + dx, y + dy) for x, y in points]})
        elif isinstance(step, ReachStep):
            x, y, z = step.to
            step = step.model_copy(update={"to": (x + dx, y + dy, z + dz)})
        steps.append(step)
    x, y = person.start
    return person.model_copy(update={"start": (x + dx, y + dy), "step": steps})


def _elsewhere(person: PersonTable, rng: Any) -> PersonTable:
    """Each walk leads a little beside its goal, each hand reaches a little beside its own."""
    steps: list[Any] = []
    for step in person.step:
        if isinstance(step, WalkStep):
            aside = rng.uniform(-STAND, STAND, 2)
            points = [step.to] if isinstance(step.to, tuple) else list(step.to)
            points[-1] = (points[-1][0] + float(aside[0]), points[-1][1] + float(aside[1]))
            step = step.model_copy(update={"to": points})
        elif isinstance(step, ReachStep):
            aside = rng.uniform(-REACH, REACH, 2)
            x, y, z = step.to
            step = step.model_copy(update={"to": (x + float(aside[0]), y + float(aside[1]), z)})
        steps.append(step)
    return person.model_copy(update={"step": steps})
