"""What is known of the limit of a trial: a row of numbers, for files, JSON and the report."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any, NamedTuple, get_type_hints


class Limit(NamedTuple):
    """What was possible in a trial, beside what a controller did. Distances are the smallest of the whole encounter.

    Attributes:
        trial: Its number; -1 for a case.
        seed: The trial's.
        motion: What the robot does.
        controller: Whose state at first detection the motion begins in.
        first_sight: When it first saw anybody [s]; NaN: never.
        distance: Under the controller [m].
        alone: Without control [m].
        limit: The largest that was found, of a motion that keeps off furniture, floor and the robot itself [m]; NaN
            where nobody was seen before contact, or no such motion was found.
        fixed: The largest that any motion could reach, given what came before it and the robot's base [m]; NaN if
            nobody was seen.
        contact: Whether the controller's run has one.
        seen: Whether anybody was seen before a contact, or there was none.
        avoidable: A contact that the motion found does not have.
        reached: (distance - alone) / (limit - alone): 0 as without control, 1 the best that was found; NaN
            where the two are equal.
        evaluations: Motions that were tried.
    """

    trial: int
    seed: int
    motion: str
    controller: str
    first_sight: float
    distance: float
    alone: float
    limit: float
    fixed: float
    contact: bool
    seen: bool
    avoidable: bool
    reached: float
    evaluations: int

    @property
    def sentence(self) -> str:
        """A summary in words."""
        if not self.contact:
            return "There was no contact."
        if not self.seen:
            return "Nobody was seen before the contact."
        if self.avoidable:
            return f"The contact was avoidable, by {1e3 * self.limit:.0f} mm at least."
        if self.fixed <= 0.0:
            return "No motion could have avoided the contact: it came too early, or was with the robot's base."
        return "No motion that avoids the contact was found; that is no proof that there is none."

    def to_dict(self) -> dict[str, Any]:
        """For JSON, with the sentence."""
        return self._asdict() | {"sentence": self.sentence}


def limit_from(said: Mapping[str, Any]) -> Limit:
    """A limit from what JSON says of it, null for NaN.

    Raises:
        ValueError: It lacks a value, has one too many, or one of another kind.
    """
    if said.keys() != set(Limit._fields):
        raise ValueError(f"a limit with {', '.join(said)}")
    values: list[Any] = []
    for name, kind in get_type_hints(Limit).items():
        value = nan if said[name] is None and kind is float else said[name]
        if type(value) is not kind:
            raise ValueError(f"{name} = {value!r}: expected {kind.__name__}")
        values.append(value)
    return Limit(*values)
