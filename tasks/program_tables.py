"""What a program file may hold: its tables and keys, their types and ranges."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

# wide enough for any robot; beyond it numbers are mistakes, and arithmetic with them would only hide which
Length = Annotated[float, Field(strict=True, ge=-100.0, le=100.0, allow_inf_nan=False)]
Angle = Annotated[float, Field(strict=True, ge=-3600.0, le=3600.0, allow_inf_nan=False)]
Rate = Annotated[float, Field(strict=True, ge=1e-4, le=1e9, allow_inf_nan=False)]
Share = Annotated[float, Field(strict=True, ge=1e-4, le=1.0, allow_inf_nan=False)]  # of the robot's own limits
Place = tuple[Length, Length, Length]
Angles = tuple[Angle, Angle, Angle]
Name = Annotated[str, Field(strict=True, min_length=1)]


class Table(BaseModel):
    """Refuses keys it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class RatesTable(Table):
    """Rates of all moves: m, deg, s."""

    speed: Rate = 0.25
    acceleration: Rate = 1.0
    jerk: Rate = 10.0
    angular_speed: Rate = 45.0
    angular_acceleration: Rate = 180.0
    angular_jerk: Rate = 1800.0
    joints: Share = 0.3


class Point(Table):
    """A place: a position in m with angles in deg, or joint positions in deg, m where a joint slides."""

    position: Place | None = None
    euler: Angles | None = None
    joints: list[Angle] | None = None


class LineSegment(Table):
    """Straight to a point."""

    do: Literal["line"]
    to: Name
    above: Length = 0.0
    speed: Rate | None = None


class ArcSegment(Table):
    """To a point through another one."""

    do: Literal["arc"]
    via: Name
    to: Name
    above: Length = 0.0
    speed: Rate | None = None


class JointSegment(Table):
    """To a point, the joints by their shortest way."""

    do: Literal["joint"]
    to: Name


class DwellSegment(Table):
    """Stay [s]."""

    do: Literal["dwell"]
    time: Annotated[float, Field(strict=True, gt=0.0, le=86400.0, allow_inf_nan=False)]


class EventSegment(Table):
    """Something to do here, then stay [s]."""

    do: Literal["event"]
    name: Name
    dwell: Annotated[float, Field(strict=True, ge=0.0, le=86400.0, allow_inf_nan=False)] = 0.0


Segment = Annotated[LineSegment | ArcSegment | JointSegment | DwellSegment | EventSegment, Field(discriminator="do")]


class ProgramFile(Table):
    """The whole file."""

    frame: Name | None = None
    cycle: Annotated[bool, Field(strict=True)] = False
    start: Name | None = None
    rates: RatesTable = RatesTable()
    points: dict[str, Point] = {}
    vary: dict[str, Annotated[list[Name], Field(min_length=1)]] = {}
    segment: Annotated[list[Segment], Field(min_length=1)]
