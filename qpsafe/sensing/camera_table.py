"""What a cell's file may say of cameras, scanners and arrays fixed in space; `ranging.cell_cameras` makes them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

_Finite = Annotated[float, Field(ge=-1e3, le=1e3, allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0.0, le=1e3, allow_inf_nan=False)]
_Pixels = Annotated[float, Field(gt=0.0, le=1e5, allow_inf_nan=False)]
_Place = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]
_Angle = Annotated[float, Field(gt=0.0, lt=180.0, allow_inf_nan=False)]
_Vector = tuple[_Finite, _Finite, _Finite]


class _Camera(BaseModel):
    """What all kinds have in common. The pose is `position` with either `quaternion` or `look_at`."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: Annotated[str, Field(min_length=1)]
    position: _Vector | None = None
    quaternion: tuple[_Finite, _Finite, _Finite, _Finite] | None = None
    look_at: _Vector | None = None
    up: _Vector | None = None
    range_min: Annotated[float, Field(ge=0.0, le=1e3, allow_inf_nan=False)] = 0.02
    range_max: _Positive
    rate: Annotated[float, Field(ge=0.01, le=1e4, allow_inf_nan=False)]
    sigma: Annotated[float, Field(ge=0.0, le=1e2, allow_inf_nan=False)] = 0.01
    max_age: _Positive | None = None


class DepthTable(_Camera):
    """A `[[camera]]` of the kind "depth": an image of pixels, with `intrinsics` or `field_of_view`."""

    kind: Literal["depth"]
    resolution: tuple[Annotated[int, Field(ge=1, le=4096)], Annotated[int, Field(ge=1, le=4096)]]
    intrinsics: tuple[_Pixels, _Pixels, _Place, _Place] | None = None
    field_of_view: tuple[_Angle, _Angle] | None = None


class ArrayTable(_Camera):
    """A `[[camera]]` of the kind "array": a time-of-flight array."""

    kind: Literal["array"]
    zones: tuple[Annotated[int, Field(ge=1, le=64)], Annotated[int, Field(ge=1, le=64)]]
    field_of_view: _Angle


class ScannerTable(_Camera):
    """A `[[camera]]` of the kind "scanner": rays in a plane."""

    kind: Literal["scanner"]
    angle_min: Annotated[float, Field(ge=-360.0, le=360.0, allow_inf_nan=False)]
    increment: Annotated[float, Field(ge=-90.0, le=90.0, allow_inf_nan=False)]
    rays: Annotated[int, Field(ge=1, le=20000)]


CameraTable = Annotated[DepthTable | ArrayTable | ScannerTable, Field(discriminator="kind")]
KINDS = ("depth", "array", "scanner")
