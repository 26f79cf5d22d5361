"""Encounters with people at random: a point of the unit cube is an encounter, a story of one or two people.

Uniform points are people as the model has them: random trials draw them from a seed, and a search for the worst moves
in the cube.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.people.file import PeopleFile
from qpsafe.sim.campaign.people.floor_plan import FloorPlan
from qpsafe.sim.campaign.people.stories import PeopleStories
from qpsafe.sim.stories.story import Story

Array = NDArray[np.float64]

#: The bundled model.
BUNDLED = Path(__file__).with_name("people.toml")
#: Sets the draws of people apart from others that begin with the same seed.
STREAM = 0x9E0


class Encounters(Protocol):
    """What makes encounters: a file of distributions, or stories."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates."""

    @property
    def choices(self) -> frozenset[str]:
        """Coordinates that choose between things; the encounter is continuous in the others, nearly everywhere."""

    def encounter(self, u: Sequence[float], plan: FloorPlan) -> Story:
        """The encounter that a point is."""

    def kinds(self, u: Sequence[float]) -> tuple[str, ...]:
        """What everybody in it comes to do."""


class EncounterModel:
    """Encounters as functions of a point of the unit cube [0, 1)^d.

    Args:
        made: What makes them; `load` reads it from a file.
    """

    def __init__(self, made: Encounters) -> None:
        self._made = made

    @classmethod
    def load(cls, path: str | Path | Sequence[str | Path] | None = None) -> EncounterModel:
        """Read a model.

        Args:
            path: A TOML file of the form of the bundled `people.toml`, which None stands for; or a story's file,
                several, or a folder of them, of which an encounter is one, varied.

        Raises:
            ConfigurationError: Names file, line, key and value of what is wrong.
        """
        paths = [BUNDLED] if path is None else [path] if isinstance(path, str | Path) else list(path)
        files = [Path(p) for p in paths]
        if len(files) == 1 and files[0].is_dir():
            files = sorted(files[0].glob("*.toml"))
        if not files:
            raise ConfigurationError("EncounterModel", "path", path, "TOML files")
        if len(files) == 1 and not PeopleStories.is_story(files[0]):
            return cls(PeopleFile.read(files[0]))
        return cls(PeopleStories(files))

    @property
    def dimensions(self) -> int:
        """d."""
        return len(self._made.names)

    @property
    def names(self) -> tuple[str, ...]:
        """What every coordinate says, such as ``first.azimuth``, (d,)."""
        return self._made.names

    @property
    def continuous(self) -> NDArray[np.bool_]:
        """Which coordinates an encounter is continuous in (d,), nearly everywhere; the others choose."""
        return np.array([name not in self._made.choices for name in self._made.names])

    def random(self, seed: int) -> Array:
        """A random encounter: u (d,), uniform; the same seed gives the same one."""
        return np.random.default_rng([seed, STREAM]).random(self.dimensions)

    def encounter(self, u: Sequence[float] | Array, plan: FloorPlan) -> Story:
        """The encounter that a point is.

        Args:
            u: (d,), from 0 to 1.
            plan: The cell where people come near the robot.

        Raises:
            ConfigurationError: `u` is no such point.
        """
        return self._made.encounter(self._checked(u), plan)

    def kinds(self, u: Sequence[float] | Array) -> tuple[str, ...]:
        """What everybody in an encounter comes to do, such as ``("reach", "past")``, without planning it."""
        return self._made.kinds(self._checked(u))

    def _checked(self, u: Sequence[float] | Array) -> list[float]:
        point = np.asarray(u, dtype=float)
        if point.shape != (self.dimensions,) or not ((point >= 0.0) & (point <= 1.0)).all():
            expected = f"{self.dimensions} numbers from 0 to 1"
            raise ConfigurationError("EncounterModel", "u", u, expected)
        found: list[float] = point.tolist()
        return found
