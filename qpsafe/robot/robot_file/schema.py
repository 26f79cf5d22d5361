"""What a `robot.toml` may say, and how what it says becomes SI units.

The file is checked in two steps: the shape and type of every value (pydantic, `RobotFile`), then what the values
say about each other (`check`). Whatever is wrong becomes a `RobotFileError` that
names the file, the key and the value.
"""

from __future__ import annotations

import math
import os
import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic

from qpsafe.errors import RobotFileError
from qpsafe.robot.robot_file.parameter_tables import (
    DangerTable,
    EvasionTable,
    GateTable,
    Number,
    Positive,
    RecoveryTable,
    SensingTable,
    Table,
)
from qpsafe.text.complaints import expected_words
from qpsafe.text.lines import toml_lines
from qpsafe.text.toml_parse import read_bounded, toml_table
from qpsafe.text.words import counted

Name = Annotated[str, pydantic.Field(strict=True, min_length=1)]
Pair = Annotated[list[Name], pydantic.Field(min_length=2, max_length=2)]


class Units(Table):
    """Units of the figures in the file; they must be stated, none has a default."""

    length: Literal["m", "mm"]
    angle: Literal["rad", "deg"]
    mass: Literal["kg"]
    time: Literal["s"]

    @property
    def metres(self) -> float:
        """Metres in one unit of length."""
        return {"m": 1.0, "mm": 1e-3}[self.length]

    @property
    def radians(self) -> float:
        """Radians in one unit of angle."""
        return {"rad": 1.0, "deg": math.pi / 180.0}[self.angle]


class JointLimits(Table):
    """Limits of one joint: angle, angle per time, angle per time squared; length where it slides."""

    lower: Number
    upper: Number
    max_velocity: Positive
    max_acceleration: Positive


class DHRow(Table):
    """One row of a standard Denavit-Hartenberg table: T = Rz(q + theta) Tz(d) Tx(a) Rx(alpha)."""

    theta: Number
    d: Number
    a: Number
    alpha: Number


class DenavitHartenberg(Table):
    """The table, one row a joint, the frames it leads to, one more than rows, and its joints if these are not all."""

    frames: list[Name]
    rows: list[DHRow]
    joints: list[Name] | None = None


class WireTable(Table):
    """Segments of the wire model as pairs of frame names."""

    links: Annotated[
        list[Annotated[list[Name], pydantic.Field(min_length=2, max_length=2)]], pydantic.Field(min_length=1)
    ]


class ToolTable(Table):
    """The mounted tool: its tip's frame, the frame it is mounted on, the tip's place in that frame, its mass."""

    frame: Name
    mounted_on: Name
    offset: Annotated[list[Number], pydantic.Field(min_length=3, max_length=3)]
    mass: Annotated[float, pydantic.Field(strict=True, allow_inf_nan=False, ge=0)]


class RegionTable(Table):
    """A part of the surface that may carry sensors: what lies in a box, in the frame of the link that carries them.

    `link` counts wire links from 1. `frame` is the Denavit-Hartenberg frame of the link if it is not given. `mesh` is a
    file in the robot's folder, in that frame and in the file's unit of length; the model's own geometry if not given.
    `at_most` sensors are put there, any number if not given. `self_sight` is the share of random
    configurations in which a place there may see the robot itself from close by.
    """

    name: Name
    link: Annotated[int, pydantic.Field(strict=True, ge=1)]
    frame: Name | None = None
    lower: Annotated[list[Number], pydantic.Field(min_length=3, max_length=3)]
    upper: Annotated[list[Number], pydantic.Field(min_length=3, max_length=3)]
    mesh: Name | None = None
    at_most: Annotated[int, pydantic.Field(strict=True, ge=0)] | None = None
    self_sight: Annotated[float, pydantic.Field(strict=True, ge=0.0, le=1.0)] = 0.02


class EgmTable(Table):
    """Of the wire to an ABB controller: joints that it takes for external ones, in its order, e.g. a seventh axis."""

    external: list[Name]


class RobotFile(Table):
    """A whole `robot.toml`, in the units of the file."""

    name: Name
    title: Name
    manufacturer: str = ""
    model: Name
    spots: Name | None = None
    home: list[Number]
    units: Units
    joints: Annotated[dict[str, JointLimits], pydantic.Field(min_length=1)]
    hold: dict[str, Number] = pydantic.Field(default_factory=dict)
    denavit_hartenberg: tuple[DenavitHartenberg, ...] = ()
    frames: Annotated[dict[str, Name], pydantic.Field(min_length=1)]
    wire: WireTable
    tool: tuple[ToolTable, ...] = ()
    danger: DangerTable | None = None
    evasion: EvasionTable | None = None
    recovery: RecoveryTable | None = None
    sensing: SensingTable | None = None
    gate: GateTable | None = None
    regions: list[RegionTable] = pydantic.Field(default_factory=list)
    egm: EgmTable | None = None

    @pydantic.field_validator("tool", "denavit_hartenberg", mode="before")
    @classmethod
    def _one_or_many(cls, value: Any) -> Any:
        """[tool] for one, [[tool]] for several."""
        return [value] if isinstance(value, dict) else value


def read_robot_file(path: Path) -> RobotFile:
    """Read and check one `robot.toml`.

    Args:
        path: The file.

    Returns:
        Its values, in its own units, consistent with each other.

    Raises:
        RobotFileError: The file is missing, is no TOML, or a value in it is wrong.
    """
    try:
        text = read_bounded(path)
    except (OSError, ValueError) as error:
        raise RobotFileError(path, "file", path.name, f"a readable UTF-8 file ({error})") from error
    try:
        raw = toml_table(text)
    except tomllib.TOMLDecodeError as error:
        raise _syntax_error(path, text, error) from error
    try:
        file = RobotFile.model_validate(raw)
    except pydantic.ValidationError as error:
        raise _named_error(path, error, raw) from error
    check(path, file)
    return file


def check(path: Path, file: RobotFile) -> None:
    """Check what the values of one file say about each other.

    Raises:
        RobotFileError: Limits in the wrong order, a home outside them, a table of the wrong length, an unknown frame.
    """
    for name, joint in file.joints.items():
        if not joint.lower < joint.upper:
            expected = f"less than upper = {joint.upper!r}"
            raise RobotFileError(path, f"joints.{name}.lower", joint.lower, expected)
    for name, value in file.hold.items():
        if name in file.joints:
            raise RobotFileError(path, f"hold.{name}", value, f"a joint without limits: [joints.{name}] says it moves")
    if len(file.home) != len(file.joints):
        raise RobotFileError(path, "home", file.home, f"{len(file.joints)} values, one a joint")
    for i, (value, (name, joint)) in enumerate(zip(file.home, file.joints.items(), strict=True)):
        if not joint.lower <= value <= joint.upper:
            expected = f"within the limits of {name}, {joint.lower!r} to {joint.upper!r}"
            raise RobotFileError(path, f"home[{i}]", value, expected)
    for i, link in enumerate(file.wire.links):
        _known_frames(path, f"wire.links[{i}]", link, file.frames)
    for i, tool in enumerate(file.tool):
        key = table_key("tool", i, len(file.tool))
        _known_frames(path, f"{key}.frame", [tool.frame], file.frames)
        _known_frames(path, f"{key}.mounted_on", [tool.mounted_on], file.frames)
    for i, table in enumerate(file.denavit_hartenberg):
        key = table_key("denavit_hartenberg", i, len(file.denavit_hartenberg))
        joints = list(file.joints) if table.joints is None else table.joints
        for name in joints:
            if name not in file.joints:
                raise RobotFileError(path, f"{key}.joints", name, "one of the joints: " + ", ".join(file.joints))
        if len(table.rows) != len(joints):
            raise RobotFileError(path, f"{key}.rows", f"{len(table.rows)} rows", f"{len(joints)} rows, one a joint")
        if len(table.frames) != len(table.rows) + 1:
            expected = f"{counted(len(table.rows) + 1, 'frame')}: the base's and one a joint"
            raise RobotFileError(path, f"{key}.frames", table.frames, expected)
        _known_frames(path, f"{key}.frames", table.frames, file.frames)
    danger = file.danger
    if danger is not None and danger.delta_f * (1.0 + danger.epsilon_f) > danger.delta * (1.0 - danger.epsilon):
        expected = "delta_f (1 + epsilon_f) <= delta (1 - epsilon), or two levels of Table I overlap"
        raise RobotFileError(path, "danger.delta_f", danger.delta_f, expected)
    for key, values in () if file.evasion is None else sorted(file.evasion):
        if values is not None and len(values) != len(file.joints):
            raise RobotFileError(path, f"evasion.{key}", values, f"{len(file.joints)} values, one a joint")
    for name in () if file.egm is None else file.egm.external:
        if name not in file.joints:
            raise RobotFileError(path, "egm.external", name, "one of the joints: " + ", ".join(file.joints))
    for i, region in enumerate(file.regions):
        _check_region(path, f"regions[{i}]", region, file)
    names = [region.name for region in file.regions]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise RobotFileError(path, f"regions[{i}].name", name, "a name of its own")


def _check_region(path: Path, key: str, region: RegionTable, file: RobotFile) -> None:
    if region.link > len(file.wire.links):
        raise RobotFileError(path, f"{key}.link", region.link, f"a link in 1..{len(file.wire.links)}")
    if region.frame is not None:
        _known_frames(path, f"{key}.frame", [region.frame], file.frames)
    elif len(file.denavit_hartenberg) != 1 or region.link >= len(file.denavit_hartenberg[0].frames):
        expected = "a frame: the link has no Denavit-Hartenberg one"
        raise RobotFileError(path, f"{key}.frame", None, expected)
    for low, high in zip(region.lower, region.upper, strict=True):
        if not low < high:
            raise RobotFileError(path, f"{key}.lower", region.lower, f"below upper = {region.upper} on each axis")
    if region.mesh is not None and not os.path.isfile(path.parent / region.mesh):
        raise RobotFileError(path, f"{key}.mesh", region.mesh, "a mesh file in the same folder")


def table_key(name: str, i: int, count: int) -> str:
    """How a person finds table i of several, or the only one.

    Args:
        name: Of the tables.
        i: From 0.
        count: How many there are.
    """
    return name if count == 1 else f"{name}[{i}]"


def _known_frames(path: Path, key: str, names: list[str], frames: dict[str, str]) -> None:
    for name in names:
        if name not in frames:
            raise RobotFileError(path, key, name, "a frame of the table [frames]: " + ", ".join(frames))


def _syntax_error(path: Path, text: str, error: tomllib.TOMLDecodeError) -> RobotFileError:
    """Point at the line of the file that is no TOML."""
    place = re.search(r"line (\d+)", str(error))
    lines = toml_lines(text)
    number = int(place.group(1)) if place else len(lines)
    line = lines[number - 1].strip() if 0 < number <= len(lines) else ""
    return RobotFileError(path, f"line {number}", line, f"valid TOML ({error})")


def _named_error(path: Path, error: pydantic.ValidationError, raw: dict[str, Any]) -> RobotFileError:
    """The first complaint of pydantic, as file, key, value and what was expected."""
    first = error.errors()[0]
    parts = list(first["loc"])
    if len(parts) > 1 and isinstance(raw.get(str(parts[0])), dict) and parts[1] == 0:
        del parts[1]  # the only one of tables of which there may be several
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts).lstrip(".")
    value: Any = None if first["type"] == "missing" else first["input"]
    return RobotFileError(path, key, value, expected_words(first))
