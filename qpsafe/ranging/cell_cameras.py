"""The cameras, scanners and arrays that a cell's file says are fixed in space, as sensors of many zones.

[[camera]]
name = "ceiling"
kind = "depth"                 # "array" has zones, "scanner" has rays
resolution = [640, 480]        # columns and rows
field_of_view = [87.0, 58.0]   # deg, or intrinsics = [fx, fy, cx, cy] in pixels
position = [1.5, 0.0, 2.6]     # robot base frame, m
look_at = [0.4, 0.0, 0.3]      # or quaternion = [w, x, y, z], from the camera's frame to the robot's base
range_max = 4.0
rate = 30.0
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.camera_table import ArrayTable, DepthTable, ScannerTable
from qpsafe.sensing.cell_file import read_cell

if TYPE_CHECKING:
    from qpsafe.text.toml_text import Keys, TomlText

Array = NDArray[np.float64]

#: More pixels than any controller can take: full HD.
MOST_PIXELS = 1920 * 1080
WIDEST = 60.0  # a zone, from edge to edge [deg]


def load_cameras(path: str | Path) -> tuple[RangeSensor, ...]:
    """The sensors that a cell's file says are fixed in space, for `SafetyController(range_sensors=...)`.

    Raises:
        ConfigurationError: Names file, line, key and value of what is wrong; a camera without a pose is, too:
            `qpsafe calibrate-camera` finds it.
    """
    text, content = read_cell(path)
    found: list[RangeSensor] = []
    for k, table in enumerate(content.camera):
        if table.name in [sensor.name for sensor in found]:
            raise text.wrong(("camera", k, "name"), table.name, "a name of its own")
        if table.position is None:
            expected = "where it is [m], see qpsafe calibrate-camera"
            raise text.wrong(("camera", k, "position"), "nothing", expected)
        found.append(camera_of(table, text, k))
    return tuple(found)


def camera_of(table: DepthTable | ArrayTable | ScannerTable, text: TomlText, number: int) -> RangeSensor:
    """One `[[camera]]` as a sensor; at the robot's base, looking along x, if the table has no pose.

    Args:
        table: What the file says.
        text: Of the file.
        number: Of the table, from 0.

    Raises:
        ConfigurationError: Names file, line, key and value of what is wrong.
    """
    here: Keys = ("camera", number)
    pose = _pose(table, text, here)
    parts: dict[str, object] = {
        "pose": pose, "range_min": table.range_min, "range_max": table.range_max, "period": 1.0 / table.rate,
        "sigma": table.sigma, "max_age": table.max_age,
    }  # fmt: skip
    try:
        if isinstance(table, DepthTable):
            columns, rows = table.resolution
            if rows * columns > MOST_PIXELS:
                raise text.wrong((*here, "resolution"), table.resolution, f"at most {MOST_PIXELS} pixels")
            return RangeSensor.camera(table.name, (rows, columns), _intrinsics(table, text, here), **parts)
        if isinstance(table, ArrayTable):
            rows, columns = table.zones
            if table.field_of_view / max(rows, columns) > WIDEST:
                raise text.wrong((*here, "field_of_view"), table.field_of_view, f"zones of at most {WIDEST:g} deg")
            return RangeSensor.array(table.name, rows, columns, np.deg2rad(table.field_of_view), **parts)
        first, step = np.deg2rad(table.angle_min), np.deg2rad(table.increment)
        return RangeSensor.planar(table.name, first, step, table.rays, **parts)
    except ConfigurationError as problem:
        if problem.where == f"RangeSensor {table.name!r}":
            width = "increment" if isinstance(table, ScannerTable) else "intrinsics"
            key = {"half_angle": width, "period": "rate"}.get(problem.key, problem.key)
            raise text.wrong((*here, key), problem.value, problem.expected) from None
        raise


def looking(position: ArrayLike, at: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0), planar: bool = False) -> Array:
    """Pose (4, 4) of a camera (z ahead, y down) or a planar scanner (x ahead, z up) that looks at a place.

    Args:
        position: Of the camera (3,) [m].
        at: What it looks at (3,) [m].
        up: What is up in its image; does not have to be upright to its line of sight.
        planar: Whether it is a scanner.

    Raises:
        ConfigurationError: The place is where the camera is, or above or below it as `up` goes.
    """
    ahead, above = np.asarray(at, dtype=float) - np.asarray(position, dtype=float), np.asarray(up, dtype=float)
    across = np.cross(ahead, above)
    if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(ahead) * np.linalg.norm(above) > 0.0:
        raise ConfigurationError("camera", "look_at", np.asarray(at).tolist(), "a place not along `up` from the camera")
    ahead, across = ahead / np.linalg.norm(ahead), across / np.linalg.norm(across)
    down = np.cross(ahead, across)
    pose = np.eye(4)
    pose[:3, :3] = np.stack((ahead, -across, -down) if planar else (across, down, ahead), axis=1)
    pose[:3, 3] = position
    return pose


def quaternion_of(R: ArrayLike) -> Array:
    """Unit quaternion w, x, y, z (4,) of a rotation matrix (3, 3), w >= 0."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(np.asarray(R)).as_quat(canonical=True)
    return np.array([w, x, y, z])


def _pose(table: DepthTable | ArrayTable | ScannerTable, text: TomlText, here: Keys) -> Array:
    planar = isinstance(table, ScannerTable)
    if table.position is None:
        if table.quaternion is not None or table.look_at is not None:
            raise text.wrong((*here, "position"), "nothing", "where the camera is [m]")
        return looking(np.zeros(3), (1.0, 0.0, 0.0), planar=planar)
    if (table.quaternion is None) == (table.look_at is None):
        both = "nothing" if table.quaternion is None else "both"
        raise text.wrong((*here, "look_at"), both, "either look_at or quaternion")
    if table.look_at is not None:
        try:
            return looking(table.position, table.look_at, table.up or (0.0, 0.0, 1.0), planar)
        except ConfigurationError as problem:
            raise text.wrong((*here, problem.key), problem.value, problem.expected) from None
    from scipy.spatial.transform import Rotation

    w, x, y, z = quaternion = np.array(table.quaternion)
    if not abs(float(np.linalg.norm(quaternion)) - 1.0) <= 1e-3:  # a person writes a few digits
        raise text.wrong((*here, "quaternion"), list(table.quaternion or ()), "w, x, y, z of length 1")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat([x, y, z, w]).as_matrix(), table.position
    return pose


def _intrinsics(table: DepthTable, text: TomlText, here: Keys) -> tuple[float, float, float, float]:
    given, angles = table.intrinsics, table.field_of_view
    if given is not None and angles is None:
        return given
    if given is not None or angles is None:
        both = "nothing" if given is None else "both"
        raise text.wrong((*here, "intrinsics"), both, "either intrinsics or field_of_view")
    fov = np.deg2rad(angles)
    columns, rows = table.resolution
    fx, fy = 0.5 * columns / np.tan(0.5 * fov[0]), 0.5 * rows / np.tan(0.5 * fov[1])
    return float(fx), float(fy), 0.5 * (columns - 1), 0.5 * (rows - 1)
