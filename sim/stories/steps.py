"""What a story's file may say: people and their steps, checked key by key."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from qpsafe.sim.people.anatomy import HURRYING, REACHING

Finite = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-100.0, le=100.0)]
Place = tuple[Finite, Finite]
Point = tuple[Finite, Finite, Finite]
Name = Annotated[str, Field(strict=True, min_length=1, max_length=60)]
WalkingSpeed = Annotated[float, Field(strict=True, ge=0.5, le=HURRYING)]
HandSpeed = Annotated[float, Field(strict=True, ge=0.05, le=REACHING)]
Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
Early = Annotated[float, Field(strict=True, ge=0.0, le=3.0)]
Ease = Annotated[float, Field(strict=True, ge=0.2, le=5.0)]
Time = Annotated[float, Field(strict=True, ge=0.0, le=3600.0)]


class Table(BaseModel):
    """A table of the file: no key that is not named, nothing converted."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Step(Table):
    """What all steps share: the name of an event that happens when the step is done."""

    event: Name | None = None


class WalkStep(Step):
    """Walk along way-points [m], turning towards travel, or keeping the heading."""

    do: Literal["walk"]
    to: Place | Annotated[list[Place], Field(min_length=1)]
    speed: WalkingSpeed = 1.0
    facing: Literal["travel", "keep"] = "travel"
    ease: Ease | None = None  # time to reach the speed, to go round a corner, and to stop [s]
    stop: Ease | None = None  # to stop, if that takes another time [s]


class WaitStep(Step):
    """Stand for a time, or until a time of the story [s]."""

    do: Literal["wait"]
    time: Time | None = None
    until: Time | None = None


class TurnStep(Step):
    """Turn on the spot to a heading [deg], or towards a place [m]."""

    do: Literal["turn"]
    heading: Annotated[float, Field(strict=True, ge=-360.0, le=360.0)] | None = None
    towards: Place | None = None
    rate: Annotated[float, Field(strict=True, ge=10.0, le=400.0)] = 120.0


class HandStep(Step):
    """What steps that move hands on a chosen profile share: `late` moves the peak of the speed (minimum jerk only)."""

    arm: Literal["left", "right", "both"] = "right"
    speed: HandSpeed = 1.0
    profile: Literal["cosine", "minimum-jerk"] = "cosine"
    late: Share = 0.0


class ReachStep(HandStep):
    """Bring a hand, or both, to a point of the world [m]; both stay `apart` from each other."""

    do: Literal["reach"]
    to: Point
    apart: Annotated[float, Field(strict=True, ge=0.0, le=1.0)] = 0.16
    early: Early = 0.0  # how long before the end of the step before it begins, while walking, say [s]


class RetractStep(HandStep):
    """Let the arms hang again."""

    do: Literal["retract"]
    arm: Literal["left", "right", "both"] = "both"


class StumbleStep(Step):
    """Fall forwards: the trunk leans, the hands are thrown ahead; then rise again. Speeds are seen from the walker."""

    do: Literal["stumble"]
    early: Early = 0.5  # as of a reach [s]
    lean: Annotated[float, Field(strict=True, ge=5.0, le=60.0)] = 40.0  # [deg]
    speed: Annotated[float, Field(strict=True, ge=0.3, le=3.0)] = 1.5
    down: Annotated[float, Field(strict=True, ge=0.0, le=60.0)] = 0.3  # how long they stay so [s]
    rise: Annotated[float, Field(strict=True, ge=0.2, le=10.0)] = 1.0  # time to rise [s]


class PutDownStep(Step):
    """Stand the board on a surface `onto` above the floor [m], and let it go."""

    do: Literal["put_down"]
    onto: Annotated[float, Field(strict=True, ge=0.0, le=1.5)] = 0.0
    speed: HandSpeed = 0.8


class CarryStep(Step):
    """Take the board up again, from where it was put down."""

    do: Literal["carry"]
    speed: HandSpeed = 0.8


class LookStep(Step):
    """Look at a point of the world [m]; without one, ahead."""

    do: Literal["look"]
    at: Point | None = None


AnyStep = Annotated[
    WalkStep | WaitStep | TurnStep | ReachStep | RetractStep | StumbleStep | PutDownStep | CarryStep | LookStep,
    Field(discriminator="do"),
]
KINDS = ("walk", "wait", "turn", "reach", "retract", "stumble", "put_down", "carry", "look")


class BoardTable(Table):
    """A card board, and how it is held [m]."""

    width: Annotated[float, Field(strict=True, ge=0.2, le=1.2)] = 0.60
    height: Annotated[float, Field(strict=True, ge=0.1, le=1.5)] = 0.70
    thickness: Annotated[float, Field(strict=True, ge=0.002, le=0.1)] = 0.006
    reach: Annotated[float, Field(strict=True, ge=0.3, le=0.6)] = 0.42
    centre_height: Annotated[float, Field(strict=True, ge=0.8, le=1.6)] = 1.20
    carried: Annotated[bool, Field(strict=True)] = True  # else it stands on the floor before the person


class PersonTable(Table):
    """A person: where they start, and what they do."""

    name: Name
    start: Place
    heading: Annotated[float, Field(strict=True, ge=-360.0, le=360.0)] = 0.0
    height: Annotated[float, Field(strict=True, ge=1.40, le=2.10)] = 1.75
    board: BoardTable | None = None
    repeat: Annotated[int, Field(strict=True, ge=1, le=1000)] = 1
    step: list[AnyStep] = []


class StoryTable(Table):
    """A whole story."""

    title: str = ""
    duration: Annotated[float, Field(strict=True, gt=0.0, le=3600.0)] | None = None
    person: Annotated[list[PersonTable], Field(min_length=1, max_length=10)]
