"""The third experiment's people, and how they vary from day to day."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from qpsafe.sim.stories.file import load_story
from qpsafe.sim.stories.steps import PersonTable, ReachStep, WalkStep
from qpsafe.sim.stories.story import Story

STAND, REACH = 0.04, 0.02  # how far people stand and reach from where the file says, to each side [m]


def load_people(path: Path, seed: int = 0) -> Story:
    """A story as another day would see it: other times and speeds (`Story.varied`), other places.

    Args:
        path: The TOML file.
        seed: 0 is the story itself; the same seed gives the same one.
    """
    story = load_story(path)
    if seed == 0:
        return story
    rng = np.random.default_rng([seed, 14])
    people = [_elsewhere(person, rng) for person in story.varied(seed).table.person]
    return Story(story.table.model_copy(update={"person": people}), story.text, story.floor)


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
