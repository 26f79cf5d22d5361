"""A story as a TOML file that a person can edit; what is wrong in it is named with its line.

[[person]]
name = "Ada"
start = [3.0, 0.5]                # m, robot base frame
heading = 180.0                   # deg; 0 looks along +x
height = 1.75                     # m

[[person.step]]
do = "walk"                       # walk, wait, turn, reach, retract, stumble, carry, put_down or look
to = [[1.5, 0.5], [0.9, 0.1]]     # m
speed = 1.2                       # 0.5 to 2.5 m/s

[[person.step]]
do = "reach"
arm = "right"                     # left, right or both
to = [0.5, 0.1, 0.4]              # m; refused if the arm is too short from there
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from qpsafe.errors import ConfigurationError
from qpsafe.sim.stories.steps import KINDS, StoryTable
from qpsafe.sim.stories.story import StepProblem, Story
from qpsafe.text.toml_text import TomlText

__all__ = ["StoryError", "load_story", "parse_story"]


class StoryError(ConfigurationError):
    """A story's file is wrong; `where` holds file and line."""


def load_story(path: str | Path, *, floor: float = -0.55) -> Story:
    """Read a story, and plan it.

    Args:
        path: The TOML file.
        floor: Height of the floor in the world frame; `build_scene` puts the robot on a pedestal of 0.55 m [m].

    Raises:
        StoryError: Names file, line, key and value of what is wrong: malformed TOML, an unknown key or kind of step, a
            speed that nobody walks at, a point out of reach with the distance that is missing, steps that do not fit.
    """
    return _planned(TomlText.read(Path(path), StoryError), floor)


def parse_story(text: str, path: str | Path = "story", *, floor: float = -0.55) -> Story:
    """Plan a story from its text; `path` only names it in errors. See `load_story`.

    Args:
        text: TOML.
        path: Names it in errors.
        floor: Height of the floor [m].
    """
    return _planned(TomlText(text, path, StoryError), floor)


def _planned(text: TomlText, floor: float) -> Story:
    file = text.checked(StoryTable, _is_key)
    try:
        return Story(file, text.text, floor)
    except StepProblem as problem:
        raise text.wrong(["person", problem.person, *problem.keys], problem.value, problem.expected) from None


def _is_key(before: Sequence[str | int], key: str | int) -> bool:
    """Pydantic's location also has the kind of a step and the branch of a union, which are no keys."""
    after_step = len(before) >= 2 and before[-2] == "step" and isinstance(before[-1], int)
    return not (after_step and key in KINDS) and not (isinstance(key, str) and ("[" in key or key == "tuple"))
