"""Encounters from a file of distributions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from qpsafe.sim.campaign.people.draws import CHOICES, NAMES, PERSON, SHARED, Draw, draw
from qpsafe.sim.campaign.people.floor_plan import FloorPlan
from qpsafe.sim.campaign.people.kinds import Visit
from qpsafe.sim.campaign.people.tables import PeopleTable
from qpsafe.sim.stories.steps import StoryTable
from qpsafe.sim.stories.story import Story
from qpsafe.text.toml_text import TomlText


class PeopleFile:
    """One or two people who do what the file says with the distributions that it says.

    Args:
        table: The checked file.
    """

    names: tuple[str, ...] = NAMES
    choices: frozenset[str] = CHOICES

    def __init__(self, table: PeopleTable) -> None:
        self.table = table

    @classmethod
    def read(cls, path: Path) -> PeopleFile:
        """Read a file.

        Raises:
            ConfigurationError: Names file, line, key and value of what is wrong.
        """
        return cls(TomlText.read(path).checked(PeopleTable))

    def draws(self, u: Sequence[float]) -> tuple[Draw, ...]:
        """What everybody is like (d,) -> one or two."""
        table, shared, count = self.table, dict(zip(SHARED, u, strict=False)), len(PERSON)
        first, second = u[len(SHARED) : len(SHARED) + count], u[len(SHARED) + count :]
        at = PERSON.index("azimuth")
        azimuth = math.radians(table.approach.azimuth.at(first[at]))
        found = [draw(table, first, azimuth, 0.0)]
        if shared["second"] < table.encounter.second.share:
            beside = math.radians(table.encounter.apart.at(second[at]))
            found.append(draw(table, second, azimuth + beside, table.encounter.later.at(second[PERSON.index("delay")])))
        return tuple(found)

    def kinds(self, u: Sequence[float]) -> tuple[str, ...]:
        """What everybody comes to do."""
        return tuple(one.kind for one in self.draws(u))

    def encounter(self, u: Sequence[float], plan: FloorPlan) -> Story:
        """The story."""
        draws = self.draws(u)
        people = [Visit(one, plan).table(name) for one, name in zip(draws, ("first", "second"), strict=False)]
        title = ", ".join(one.kind for one in draws)
        duration = self.table.encounter.duration.at(u[SHARED.index("duration")])
        table = StoryTable.model_validate({"title": title, "duration": duration, "person": people})
        return Story(table, floor=plan.floor)
