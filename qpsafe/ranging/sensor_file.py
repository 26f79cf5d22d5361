"""The TOML file of a robot's time-of-flight arrays: that of spots, with zones, a rate and a deviation."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.skin.spot_file import Angle, SpotFile, read_tables
from qpsafe.text.toml_parse import read_bounded, toml_table

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

_Zones = Annotated[int, Field(strict=True, ge=1, le=64)]
_Deviation = Annotated[float, Field(strict=True, ge=0.0, le=1e3, allow_inf_nan=False)]
_Rate = Annotated[float, Field(strict=True, ge=0.01, le=1e4, allow_inf_nan=False)]
#: Name of such a file in a robot's folder, and what stands in it for the sensor.
PATTERN = "spots-{}.toml"
WIDEST = 60  # a zone, from edge to edge [deg]


class ArrayFile(SpotFile):
    """Contents of a `spots-SENSOR.toml`: what all arrays have in common, and a `[[spot]]` for each.

    Attributes:
        zones: Rows and columns of each array.
        field_of_view: From edge to edge, along rows and columns alike, not along the diagonal [deg].
        rate: Images a second [Hz].
        sigma: Standard deviation of a reading where an image does not tell [m].
    """

    zones: tuple[_Zones, _Zones]
    field_of_view: Angle
    rate: _Rate
    sigma: _Deviation


def read_range_sensors(path: Path, robot: Robot) -> list[RangeSensor]:
    """Read and check a file of time-of-flight arrays on a robot's skin.

    Their points act on the link that is nearest to each; the file's `link` says which carries the array.

    Args:
        path: The file.
        robot: Robot that carries them.

    Raises:
        RobotFileError: Names file, key and value of what is wrong, as for a `spots.toml`, and zones that are wider
            than a sensor's may be.
    """
    file, spots = read_tables(path, robot, ArrayFile)
    sensors = []
    for i, (table, spot) in enumerate(zip(file.spot, spots, strict=True)):
        key, zone = f"spot[{i}] ({spot.name})", np.rad2deg(spot.field_of_view) / max(file.zones)
        if not 0.0 < zone <= WIDEST:
            where = "field_of_view" if table.field_of_view is None else f"{key}.field_of_view"
            found = file.field_of_view if table.field_of_view is None else table.field_of_view
            rows, columns = file.zones
            raise RobotFileError(path, where, found, f"zones ({rows} x {columns}) of more than 0, at most {WIDEST} deg")
        try:
            sensor = RangeSensor.array(
                spot.name, *file.zones, spot.field_of_view, mount=spot.frame, pose=spot.pose,
                range_min=spot.range_min, range_max=spot.range_max, period=1.0 / file.rate, sigma=file.sigma,
            )  # fmt: skip
        except ConfigurationError as error:
            raise RobotFileError(path, f"{key}.{error.key}", error.value, error.expected) from None
        sensors.append(sensor)
    return sensors


def range_sensor_files(robot: Robot) -> dict[str, Path]:
    """What `load_range_sensors` finds in a robot's folder: the names of sensors and their files."""
    head, tail = PATTERN.split("{}")
    found = {path.name.removeprefix(head).removesuffix(tail): path for path in robot.folder.glob(PATTERN.format("*"))}
    return {name: found[name] for name in sorted(found) if _has_zones(found[name])}


def _has_zones(path: Path) -> bool:
    """Whether a file is for arrays, not for spots such as `spots-by-hand.toml`."""
    try:
        return "zones" in toml_table(read_bounded(path))
    except (OSError, ValueError):
        return False


def load_range_sensors(robot: Robot | str | Path, sensors: str | Path = "vl53l5cx") -> list[RangeSensor]:
    """The arrays of many zones that a robot carries.

    Args:
        robot: The robot, or what `load_robot` finds it by.
        sensors: What they are: `spots-SENSOR.toml` in the robot's folder; or the name of a file there, or a path.

    Raises:
        ConfigurationError: The robot's folder has no such file; names those that it has.
        RobotFileError: The file is wrong, see `read_range_sensors`.
    """
    where = "load_range_sensors"
    if isinstance(robot, str | Path):
        from qpsafe.robot.loader import load_robot

        robot = load_robot(robot)
    if not hasattr(robot, "wire_frames"):
        raise ConfigurationError(where, "robot", robot, "a Robot, or what load_robot finds it by")
    if not isinstance(sensors, str | Path):
        raise ConfigurationError(where, "sensors", sensors, "a sensor's name, or a path")
    for path in (robot.folder / PATTERN.format(sensors), robot.folder / sensors, Path(sensors)):
        if os.path.isfile(path):  # no error for names that no system can have
            return read_range_sensors(path, robot)
    known = ", ".join(range_sensor_files(robot)) or "none"
    expected = f"a file, or a sensor of which {robot.name} has a {PATTERN.format('SENSOR')}: {known}"
    raise ConfigurationError(where, "sensors", str(sensors), expected)
