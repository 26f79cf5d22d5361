"""A story as a TOML file that a person can edit; what is wrong in it is named with its line.

[[person]]
name = "Ada"
start = [3.0, 0.5]                # m, robot base frame
heading = 180.0                   # deg; 0 looks along +x
height = 1.75                     # m

[[person.step]]
do = "walk"                       # walk, wait, turn, reach, retract, carry, put_down or look
to = [[1.5, 0.5], [0.9, 0.1]]     # m
speed = 1.2                       # 0.5 to 2.0 m/s

[[person.step]]
do = "reach"
arm = "right"                     # left, right or both
to = [0.5, 0.1, 0.4]              # m; refused if the arm is too short from there
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

from pydantic import ValidationError

from qpsafe.errors import ConfigurationError
from qpsafe.sim.story import StepProblem, Story
from qpsafe.sim.story_steps import KINDS, StoryTable
from qpsafe.tasks.lines import line_of

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
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise StoryError(path, "file", str(problem), "a readable TOML file") from None
    return parse_story(text, path, floor=floor)


def parse_story(text: str, path: str | Path = "story", *, floor: float = -0.55) -> Story:
    """Plan a story from its text; `path` only names it in errors. See `load_story`."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        found = re.search(r"at line (\d+)", str(problem))
        line = found.group(1) if found else str(len(text.splitlines()))
        raise StoryError(f"{path}:{line}", "file", str(problem), "well-formed TOML") from None
    try:
        file = StoryTable.model_validate(table)
    except ValidationError as problem:
        first = problem.errors()[0]
        value = "nothing" if first["type"] == "missing" else first["input"]
        raise _wrong(path, text, _keys(first["loc"]), value, first["msg"]) from None
    try:
        return Story(file, text, floor)
    except StepProblem as problem:
        keys = ["person", problem.person, *problem.keys]
        raise _wrong(path, text, keys, problem.value, problem.expected) from None


def _keys(location: Sequence[str | int]) -> list[str | int]:
    """Pydantic's location without what is no key: the kind of a step, the branch of a union."""
    keys: list[str | int] = []
    for key in location:
        after_step = len(keys) >= 2 and keys[-2] == "step" and isinstance(keys[-1], int)
        if not (after_step and key in KINDS) and not (isinstance(key, str) and ("[" in key or key == "tuple")):
            keys.append(key)
    return keys


def _wrong(path: str | Path, text: str, keys: Sequence[str | int], value: object, expected: str) -> StoryError:
    name = ""
    for key in keys:
        name += f"[{key}]" if isinstance(key, int) else f".{key}" if name else str(key)
    return StoryError(f"{path}:{line_of(text, keys)}", name, value, expected)
