"""Images of a camera fixed in space and where the robot was: an .npz file, or a folder of them, one an image."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from qpsafe.ranging.sensor import RangeSensor
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: Fewer images tell nothing.
FEWEST = 5
#: Of one unit of a depth image of whole numbers, where the file does not tell [m].
SCALE = 0.001


@dataclass(frozen=True, eq=False)
class Recording:
    """What a camera saw while the robot moved before it.

    Attributes:
        sensor: The camera; its pose is not used.
        q: The robot's joints at each image (n, nq) [rad].
        distances: Along the zones' directions (n, z) [m]; +inf where nothing is in sight, NaN where it cannot tell.
    """

    sensor: RangeSensor
    q: Array
    distances: Array


def load_recording(path: str | Path, sensor: RangeSensor, robot: Robot) -> Recording:
    """Read a recording.

    A file holds `q` (n, joints) [rad] and either `depth` (n, rows, columns), z of each pixel (whole numbers times
    `scale`, 0.001 m by default, 0 for none; fractions in metres) or `distances` (n, zones) along the rays [m]. Where
    the joints were measured at other times than the images, `q_stamps` (m,) says when each row of `q` (m, joints) was,
    and `stamps` (n,) when the images were [s]. In a folder every file is one image without the first axis.

    Args:
        path: The file or folder.
        sensor: The camera.
        robot: Which stands in the images.

    Raises:
        ConfigurationError: Names file, key and what is wrong.
    """
    path = Path(path)
    parts = sorted(path.glob("*.npz")) if path.is_dir() else [path]
    if not parts:
        raise ConfigurationError(path, "folder", "no file", "one .npz file an image")
    tables = [_table(part) for part in parts]
    if path.is_dir():
        stacked = {}
        for key in tables[0]:
            try:
                stacked[key] = np.stack([table[key] for table in tables])
                if key == "scale":
                    if not (stacked[key] == stacked[key][:1]).all():
                        raise ValueError
                    stacked[key] = stacked[key][0]
            except (KeyError, ValueError):
                raise ConfigurationError(path, key, "not the same in all files", "one shape, and one scale") from None
        table = stacked
    else:
        table = tables[0]
    distances = _distances(path, table, sensor)
    q = _joints(path, table, robot, len(distances))
    if len(distances) < FEWEST:
        raise ConfigurationError(path, "images", len(distances), f"at least {FEWEST}, at different configurations")
    return Recording(sensor, q, distances)


def _table(path: Path) -> dict[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {key: file[key] for key in file.files}
    except Exception as problem:  # of a broken file: whatever zip, its methods and NumPy raise
        raise ConfigurationError(path, "file", str(problem)[:200], "an .npz file without Python objects") from None


def _numbers(path: Path, table: dict[str, Any], key: str, ndim: int) -> Any:
    if key not in table:
        raise ConfigurationError(path, key, f"not among {', '.join(table) or 'no keys'}", f"an array {key!r}")
    array = table[key]
    if array.dtype.kind not in "fui" or array.ndim != ndim:
        raise ConfigurationError(path, key, f"{array.dtype} of shape {array.shape}", f"numbers with {ndim} axes")
    return array


def _distances(path: Path, table: dict[str, Any], sensor: RangeSensor) -> Array:
    if "distances" in table:
        found = table["distances"]
        found = found.reshape(len(found), np.prod(found.shape[1:])) if found.ndim == 3 else found
        found = _numbers(path, {"distances": found}, "distances", 2).astype(np.float64)
        if found.shape[1] != len(sensor):
            raise ConfigurationError(path, "distances", found.shape, f"(images, {len(sensor)} zones)")
    else:
        depth = _numbers(path, table, "depth", 3)
        if depth.shape[1:] != sensor.shape:
            raise ConfigurationError(path, "depth", depth.shape, f"(images, {sensor.shape[0]}, {sensor.shape[1]})")
        ahead = sensor.directions[:, 2]
        if not ahead.min() > 1e-3:
            raise ConfigurationError(path, "depth", sensor.name, "distances: its zones are not all ahead of it")
        flat = depth.reshape(len(depth), len(sensor))
        scale = np.asarray(table.get("scale", SCALE))
        if scale.dtype.kind not in "fui" or scale.size != 1 or not 0.0 < scale.item() < np.inf:
            raise ConfigurationError(path, "scale", str(scale)[:200], "one number > 0 [m]")
        found = np.where(flat > 0, flat * (1.0 if flat.dtype.kind == "f" else scale.item()), np.nan) / ahead
    found[~(found >= 0.0)] = np.nan
    found[found > sensor.range_max] = np.inf
    return np.asarray(found)


def _joints(path: Path, table: dict[str, Any], robot: Robot, images: int) -> Array:
    q = _numbers(path, table, "q", 2).astype(np.float64)
    if q.shape[1] != robot.nq or not np.isfinite(q).all():
        raise ConfigurationError(path, "q", f"shape {q.shape}", f"(n, {robot.nq}) finite angles [rad]")
    if "q_stamps" in table:
        times = _numbers(path, table, "q_stamps", 1).astype(np.float64)
        stamps = _numbers(path, table, "stamps", 1).astype(np.float64)
        if not len(times) or len(times) != len(q) or not (np.diff(times) > 0.0).all():
            raise ConfigurationError(path, "q_stamps", f"{len(times)} times", f"{len(q)} that grow [s]")
        if not len(stamps) or len(stamps) != images or not (times[0] <= stamps.min() and stamps.max() <= times[-1]):
            raise ConfigurationError(path, "stamps", f"{len(stamps)} times", f"{images}, between those of q [s]")
        q = np.stack([np.interp(stamps, times, q[:, j]) for j in range(robot.nq)], axis=-1)
    if len(q) != images:
        raise ConfigurationError(path, "q", f"{len(q)} rows", f"{images}, one an image; or q_stamps and stamps")
    return np.asarray(q)
