"""What a `spots.toml` may say, and the checks that name what is wrong in it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qpsafe.errors import RobotFileError
from qpsafe.sensing.body import body_hull_set
from qpsafe.sensing.skin.spot import Spot, axes_along
from qpsafe.text.complaints import expected_words
from qpsafe.text.toml_parse import read_bounded, toml_table

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

_Finite = Annotated[float, Field(strict=True, ge=-1e3, le=1e3, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, gt=0.0, le=1e3, allow_inf_nan=False)]
Angle = Annotated[float, Field(strict=True, ge=0.0, le=90.0, allow_inf_nan=False)]
_Vector = tuple[_Finite, _Finite, _Finite]

#: A spot this deep inside its own link looks at nothing but the link [m].
BURIED = 0.002


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SpotTable(_Table):
    """One `[[spot]]`: with either `direction` (a unit vector) or `rotation` (3 x 3, z along the measurement).

    `frame` is the Denavit-Hartenberg frame of the link if it is not given; ranges and field of view are the file's.
    """

    name: Annotated[str, Field(strict=True, min_length=1)]
    link: Annotated[int, Field(strict=True, ge=1)]
    frame: str | None = None
    position: _Vector
    direction: _Vector | None = None
    rotation: tuple[_Vector, _Vector, _Vector] | None = None
    range_min: Positive | None = None
    range_max: Positive | None = None
    field_of_view: Angle | None = None


class SpotFile(_Table):
    """Contents of a `spots.toml`: what all spots have in common [m, deg], and the spots."""

    sensor: str
    range_min: Positive
    range_max: Positive
    field_of_view: Angle = 0.0
    spot: list[SpotTable]


_File = TypeVar("_File", bound=SpotFile)


def read_spots(path: Path, robot: Robot) -> list[Spot]:
    """Read and check a `spots.toml`.

    Args:
        path: The file.
        robot: Robot that carries the spots.

    Raises:
        RobotFileError: Names file, key and value of what is wrong: malformed TOML, an unknown frame, a link the robot
            does not have, a direction that is not a unit vector, a rotation that is none, an empty range, two spots
            of one name, a spot inside its own link.
    """
    return read_tables(path, robot, SpotFile)[1]


def read_tables(path: Path, robot: Robot, kind: type[_File]) -> tuple[_File, list[Spot]]:
    """A file that holds spots and may say more about them, and its spots, checked as by `read_spots`.

    Args:
        path: The file.
        robot: Robot that carries the spots.
        kind: What it may say.

    Raises:
        RobotFileError: As `read_spots`.
    """
    file = _parse(path, kind)
    spots = [_spot(path, f"spot[{i}] ({table.name})", table, file, robot) for i, table in enumerate(file.spot)]
    names = [spot.name for spot in spots]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise RobotFileError(path, f"spot[{i}].name", name, "a name of its own")
    _check_outside(path, spots, robot)
    return file, spots


def _parse(path: Path, kind: type[_File]) -> _File:
    try:
        text = read_bounded(path)
    except OSError as error:
        raise RobotFileError(path, "file", str(path), f"a readable file ({error.strerror})") from None
    except ValueError as error:
        raise RobotFileError(path, "file", str(path), f"text in UTF-8 ({error})") from None
    try:
        return kind.model_validate(toml_table(text))
    except tomllib.TOMLDecodeError as error:
        raise RobotFileError(path, "file", str(path), f"valid TOML ({error})") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise RobotFileError(path, key, first.get("input"), expected_words(first)) from None


def _spot(path: Path, key: str, table: SpotTable, file: SpotFile, robot: Robot) -> Spot:
    links = len(robot.wire_frames)
    if table.link > links:
        raise RobotFileError(path, f"{key}.link", table.link, f"a link in 1..{links}")
    frame = table.frame
    if frame is None:
        if table.link >= len(robot.dh_frames):
            raise RobotFileError(path, f"{key}.frame", None, "a frame: the robot's link has no Denavit-Hartenberg one")
        frame = robot.dh_frames[table.link]
    if frame not in robot.frame_names:
        raise RobotFileError(path, f"{key}.frame", frame, f"one of {', '.join(robot.frame_names)}")
    nearest, farthest = table.range_min or file.range_min, table.range_max or file.range_max
    if not nearest < farthest:
        where = f"{key}.range_min" if table.range_min or table.range_max else "range_min"
        raise RobotFileError(path, where, nearest, f"less than range_max = {farthest}")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = _rotation(path, key, table), table.position
    angle = file.field_of_view if table.field_of_view is None else table.field_of_view
    return Spot(table.name, table.link - 1, frame, pose, nearest, farthest, float(np.deg2rad(angle)))


def _rotation(path: Path, key: str, table: SpotTable) -> NDArray[np.float64]:
    """The spot's axes in columns; about its direction it may be turned anyhow."""
    if (table.direction is None) == (table.rotation is None):
        both = None if table.direction is None else "both"
        raise RobotFileError(path, f"{key}.direction", both, "either direction or rotation")
    if table.rotation is not None:
        R = np.array(table.rotation)
        if not (np.abs(R @ R.T - np.eye(3)).max() <= 1e-6 and np.linalg.det(R) > 0.0):
            raise RobotFileError(path, f"{key}.rotation", table.rotation, "a rotation matrix")
        return R
    z = np.array(table.direction)
    if not abs(float(np.linalg.norm(z)) - 1.0) <= 1e-6:
        raise RobotFileError(path, f"{key}.direction", table.direction, "a vector of length 1")
    return axes_along(z / np.linalg.norm(z))  # a person writes a few digits


def _check_outside(path: Path, spots: list[Spot], robot: Robot) -> None:
    hulls = body_hull_set(robot)
    still = np.broadcast_to(np.eye(4), (robot.model.njoints, 4, 4))  # every body in its own frame
    for i, spot in enumerate(spots):
        frame = robot.model.frames[robot.frame_id(spot.frame)]
        own = hulls.take(np.flatnonzero(hulls.bodies == frame.parentJoint).tolist())
        here = (frame.placement.homogeneous @ spot.pose)[None, :3, 3]
        (found,) = own.find(here, np.array([-BURIED]), still)
        if found >= 0:
            expected = f"a place on the surface: this one is inside {own.names[found]}"
            raise RobotFileError(path, f"spot[{i}] ({spot.name}).position", spot.pose[:3, 3].tolist(), expected)
