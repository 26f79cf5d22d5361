"""Encounters from stories that somebody wrote: one of them, varied as on another day."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.people.floor_plan import FloorPlan
from qpsafe.sim.stories.file import load_story, parse_story
from qpsafe.sim.stories.story import Story
from qpsafe.text.toml_parse import read_bounded, toml_table

DAYS = 2**20  # so many variations of each


class PeopleStories:
    """Stories, of which a point picks one and a day.

    Args:
        paths: Their files.

    Raises:
        StoryError: One of them is wrong.
    """

    names: tuple[str, ...] = ("story", "day")
    choices: frozenset[str] = frozenset(names)

    def __init__(self, paths: Sequence[Path]) -> None:
        for path in paths:
            load_story(path)  # wrong ones are to fail now
        self._stories = [(path.stem, read_bounded(path), path) for path in paths]

    @staticmethod
    def is_story(path: Path) -> bool:
        """Whether a file is a story, right or wrong: it has people.

        Raises:
            ConfigurationError: It cannot be read.
        """
        try:
            return "person" in toml_table(read_bounded(path))
        except OSError as problem:
            raise ConfigurationError(path, "file", str(problem), "a readable TOML file") from None
        except ValueError:
            return False  # the reader of a model says what is wrong

    def encounter(self, u: Sequence[float], plan: FloorPlan) -> Story:
        """One story, varied; 0 of the day is the story itself."""
        _, text, path = self._picked(u)
        return parse_story(text, path, floor=plan.floor).varied(min(int(u[1] * DAYS), DAYS - 1))

    def kinds(self, u: Sequence[float]) -> tuple[str, ...]:
        """Name of the story's file."""
        return (self._picked(u)[0],)

    def _picked(self, u: Sequence[float]) -> tuple[str, str, Path]:
        return self._stories[min(int(u[0] * len(self._stories)), len(self._stories) - 1)]
