"""What a cell's file may say of cameras, scanners and arrays fixed in space; `ranging.cell_cameras` makes them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from qpsafe.robot.robot_file.parameter_tables import Number

#: Finer than any scanner: rays nearer to each other than this are the same one [deg].
FINEST = 1e-3

_Finite = Annotated[Number, Field(ge=-1e3, le=1e3)]
_Positive = Annotated[Number, Field(gt=0.0, le=1e3)]
_Pixels = Annotated[Number, Field(gt=0.0, le=1e5)]
_Place = Annotated[Number, Field(ge=-1e5, le=1e5)]
_Angle = Annotated[Number, Field(gt=0.0, lt=180.0)]
_Side = Annotated[int, Field(strict=True, ge=1, le=4096)]
_Zones = Annotated[int, Field(strict=True, ge=1, le=64)]
_Vector = tuple[_Finite, _Finite, _Finite]


class _Camera(BaseModel):
    """What all kinds have in common. The pose is `position` with either `quaternion` or `look_at`."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: Annotated[str, Field(min_length=1)]
    position: _Vector | None = None
    quaternion: tuple[_Finite, _Finite, _Finite, _Finite] | None = None
    look_at: _Vector | None = None
    up: _Vector | None = None
    range_min: Annotated[Number, Field(ge=0.0, le=1e3)] = 0.02
    range_max: _Positive
    rate: Annotated[Number, Field(ge=0.01, le=1e4)]
    sigma: Annotated[Number, Field(ge=0.0, le=1e2)] = 0.01
    max_age: _Positive | None = None


class DepthTable(_Camera):
    """A `[[camera]]` of the kind "depth": an image of pixels, with `intrinsics` or `field_of_view`."""

    kind: Literal["depth"]
    resolution: tuple[_Side, _Side]
    intrinsics: tuple[_Pixels, _Pixels, _Place, _Place] | None = None
    field_of_view: tuple[_Angle, _Angle] | None = None


class ArrayTable(_Camera):
    """A `[[camera]]` of the kind "array": a time-of-flight array."""

    kind: Literal["array"]
    zones: tuple[_Zones, _Zones]
    field_of_view: _Angle


class ScannerTable(_Camera):
    """A `[[camera]]` of the kind "scanner": rays in a plane."""

    kind: Literal["scanner"]
    angle_min: Annotated[Number, Field(ge=-360.0, le=360.0)]
    rays: Annotated[int, Field(strict=True, ge=1, le=20000)]
    increment: Annotated[Number, Field(ge=-90.0, le=90.0)]

    @field_validator("increment")
    @classmethod
    def _apart(cls, value: float, said: ValidationInfo) -> float:
        """No two rays look the same way but the last one of a whole turn and the first."""
        rays = said.data.get("rays", 1)
        if rays > 1 and not (abs(value) >= FINEST and (rays - 2) * abs(value) <= 360.0):
            raise ValueError(f"{rays} rays at least {FINEST} deg apart, and at most one turn of them")
        return value


CameraTable = Annotated[DepthTable | ArrayTable | ScannerTable, Field(discriminator="kind")]
KINDS = ("depth", "array", "scanner")
