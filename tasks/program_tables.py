"""What a program file may hold: its tables and keys, their types and ranges."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
Name = Annotated[str, Field(strict=True, min_length=1)]


class Table(BaseModel):
    """Refuses keys it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class RatesTable(Table):
    """Rates of all moves: m, deg, s."""

    speed: Positive = 0.25
    acceleration: Positive = 1.0
    jerk: Positive = 10.0
    angular_speed: Positive = 45.0
    angular_acceleration: Positive = 180.0
    angular_jerk: Positive = 1800.0
    joints: Annotated[float, Field(strict=True, gt=0.0, le=1.0)] = 0.3  # share of the robot's own limits


class Point(Table):
    """A place: a position in m with angles in deg, or joint positions in deg, m where a joint slides."""

    position: Vector | None = None
    euler: Vector | None = None
    joints: list[Finite] | None = None


class LineSegment(Table):
    """Straight to a point."""

    do: Literal["line"]
    to: Name
    above: Finite = 0.0
    speed: Positive | None = None


class ArcSegment(Table):
    """To a point through another one."""

    do: Literal["arc"]
    via: Name
    to: Name
    above: Finite = 0.0
    speed: Positive | None = None


class JointSegment(Table):
    """To a point, the joints by their shortest way."""

    do: Literal["joint"]
    to: Name


class DwellSegment(Table):
    """Stay [s]."""

    do: Literal["dwell"]
    time: Positive


class EventSegment(Table):
    """Something to do here, then stay [s]."""

    do: Literal["event"]
    name: Name
    dwell: Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=False)] = 0.0


Segment = Annotated[LineSegment | ArcSegment | JointSegment | DwellSegment | EventSegment, Field(discriminator="do")]


class ProgramFile(Table):
    """The whole file."""

    frame: Name = "tcp"
    cycle: Annotated[bool, Field(strict=True)] = False
    start: Name | None = None
    rates: RatesTable = RatesTable()
    points: dict[str, Point] = {}
    vary: dict[str, Annotated[list[Name], Field(min_length=1)]] = {}
    segment: Annotated[list[Segment], Field(min_length=1)]
