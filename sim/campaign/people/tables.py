"""What a file with a model of people may say, key by key; every number comes with its source."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from scipy.special import ndtr, ndtri

from qpsafe.sim.people.anatomy import HURRYING, REACHING

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1000.0, le=1000.0)]
Source = Annotated[str, Field(strict=True, min_length=2)]  # where the numbers come from; "ours" is an answer


class Table(BaseModel):
    """A table of the file: no key that is not named, nothing converted."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Spread(Table):
    """How a number is distributed: uniform between two, or normal (mean, standard deviation) cut off at two."""

    uniform: tuple[Number, Number] | None = None
    normal: tuple[Number, Number] | None = None
    within: tuple[Number, Number] | None = None
    source: Source

    @model_validator(mode="after")
    def _one(self) -> Spread:
        if (self.uniform is None) == (self.normal is None) or (self.normal is None) != (self.within is None):
            raise ValueError("either uniform = [low, high], or normal = [mean, deviation] and within = [low, high]")
        low, high = self.ends
        if not low < high or (self.normal is not None and not self.normal[1] > 0.0):
            raise ValueError("low below high, and a deviation above 0")
        if self.normal is not None and not self.below(high) > 0.0:
            raise ValueError("a mean near enough to what it is cut off at")
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value."""
        found = self.uniform or self.within
        assert found is not None  # checked
        return found

    def at(self, u: float) -> float:
        """The value that a share u, 0 to 1, of all values lies below."""
        low, high = self.ends
        if self.normal is None:
            return low + u * (high - low)
        mean, deviation = self.normal
        a, b = (float(ndtr((end - mean) / deviation)) for end in (low, high))
        return min(max(mean + deviation * float(ndtri(a + u * (b - a))), low), high)

    def below(self, value: float) -> float:
        """Share of all values below one: the inverse of `at`."""
        low, high = self.ends
        if value <= low or value >= high:
            return float(value >= high)
        if self.normal is None:
            return (value - low) / (high - low)
        mean, deviation = self.normal
        a, here, b = (float(ndtr((x - mean) / deviation)) for x in (low, value, high))
        return (here - a) / (b - a) if b > a else 0.0


class Chance(Table):
    """How many of all do it, 0 to 1."""

    share: Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
    source: Source


def mixed(parts: Sequence[Spread], weights: Sequence[float], u: float) -> float:
    """The value that a share u lies below, of numbers that come from several spreads.

    Args:
        parts: Spreads.
        weights: Share of each of them; they sum to 1.
        u: 0 to 1.
    """
    used = [(part, weight) for part, weight in zip(parts, weights, strict=True) if weight > 0.0]
    low, high = min(part.ends[0] for part, _ in used), max(part.ends[1] for part, _ in used)
    for _ in range(50):  # bisection
        middle = 0.5 * (low + high)
        low, high = (low, middle) if sum(w * part.below(middle) for part, w in used) > u else (middle, high)
    return 0.5 * (low + high)


def _inside(low: float, high: float) -> Callable[[Spread], Spread]:
    def check(spread: Spread) -> Spread:
        if not (low <= spread.ends[0] and spread.ends[1] <= high):
            raise ValueError(f"values from {low:g} to {high:g}")
        return spread

    return check


def _from(low: float, high: float) -> Any:
    return AfterValidator(_inside(low, high))


Walking = Annotated[Spread, _from(0.5, HURRYING)]  # [m/s]
Length = Annotated[Spread, _from(0.0, 20.0)]  # [m]
Time = Annotated[Spread, _from(0.0, 60.0)]  # [s]
Ratio = Annotated[Spread, _from(0.0, 5.0)]


class Kinds(Table):
    """How often people come to do what, in shares of the sum."""

    past: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)]
    straight: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)]
    inattentive: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)]
    backwards: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)]
    stumble: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)]
    reach: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)]
    turn: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)]
    source: Source

    @model_validator(mode="after")
    def _some(self) -> Kinds:
        if not sum(self.weights.values()) > 0.0:
            raise ValueError("at least one weight above 0")
        return self

    @property
    def weights(self) -> dict[str, float]:
        """Of every kind."""
        return {name: float(value) for name, value in self if name != "source"}


class EncounterTable(Table):
    """How long [s], and a second person: how often, how much later [s], from how far beside the first [deg]."""

    duration: Annotated[Spread, _from(1.0, 60.0)]
    second: Chance
    later: Time
    apart: Annotated[Spread, _from(0.0, 360.0)]


class BodyTable(Table):
    """Who comes: heights [m], and how many carry a board (of those who only walk)."""

    women: Chance
    height_women: Annotated[Spread, _from(1.40, 2.10)]
    height_men: Annotated[Spread, _from(1.40, 2.10)]
    board: Chance


class WalkTable(Table):
    """How fast they walk [m/s]; `distracted` is a factor for those who look at a phone."""

    comfortable: Walking
    hurried: Walking
    hurry: Chance
    distracted: Annotated[Spread, _from(0.1, 1.0)]
    backwards: Walking
    ease: Annotated[Spread, _from(0.1, 2.0)]  # time to stop, for every m/s [s^2/m]


class ApproachTable(Table):
    """From where and how near: direction [deg], delay [s], distances [m] and shares of the robot's reach."""

    azimuth: Annotated[Spread, _from(-360.0, 360.0)]
    delay: Time
    start: Length  # beyond the robot's reach
    stop: Length  # before pedestal or table
    stay: Time
    past: Ratio  # closest approach of those who pass, in shares of the reach
    edge: Ratio  # of those who do not look
    turn: Ratio  # where people turn round
    leave: Annotated[Spread, _from(-90.0, 90.0)]  # beside the way they came [deg]
    backwards: Chance  # how many leave backwards


class HandTable(Table):
    """Reaching in."""

    speed: Annotated[Spread, _from(0.05, REACHING)]  # [m/s]
    late: Annotated[Spread, _from(0.0, 1.0)]  # lateness of the peak over the range of speeds, slowest to fastest
    early: Annotated[Spread, _from(0.0, 3.0)]  # how long before standing still a hand sets out [s]
    along: Annotated[Spread, _from(0.0, 1.5)]  # 0 at the robot's shoulder, 1 at the tool
    aside: Annotated[Spread, _from(-1.0, 1.0)]  # of it, along every axis [m]
    stand: Annotated[Spread, _from(0.0, 2.0)]  # how far from it they stand [m]


class StumbleTable(Table):
    """Stumbling in."""

    stop: Length  # before pedestal or table, where the fall ends [m]
    lean: Annotated[Spread, _from(5.0, 60.0)]  # [deg]
    speed: Annotated[Spread, _from(0.3, 3.0)]  # of the hands, seen from the body [m/s]
    early: Annotated[Spread, _from(0.0, 3.0)]  # before the end of the walk [s]
    ease: Annotated[Spread, _from(0.1, 2.0)]  # time in which the walk is stopped, for every m/s [s^2/m]


class TurnTable(Table):
    """Turning round suddenly."""

    angle: Annotated[Spread, _from(10.0, 180.0)]  # [deg]
    rate: Annotated[Spread, _from(10.0, 400.0)]  # [deg/s]


class PeopleTable(Table):
    """The whole file."""

    title: str = ""
    kinds: Kinds
    encounter: EncounterTable
    body: BodyTable
    walk: WalkTable
    approach: ApproachTable
    hand: HandTable
    stumble: StumbleTable
    turn: TurnTable

    def speed(self, u: float) -> float:
        """Walking speed [m/s]."""
        share = self.walk.hurry.share
        return mixed((self.walk.comfortable, self.walk.hurried), (1.0 - share, share), u)

    def height(self, u: float) -> float:
        """Body height [m]."""
        share = self.body.women.share
        return mixed((self.body.height_women, self.body.height_men), (share, 1.0 - share), u)

    def kind(self, u: float) -> str:
        """What somebody comes to do."""
        weights = self.kinds.weights
        left = u * math.fsum(weights.values())
        chosen = ""
        for name, weight in weights.items():
            if weight > 0.0:
                chosen = name
                if left < weight:
                    break
                left -= weight
        return chosen
