"""Everything a robot's folder says, in SI units: the one thing a [`Robot`][qpsafe.robot.robot.Robot] is built from."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Tool(NamedTuple):
    """The mounted tool.

    Attributes:
        frame: Name of the frame at its tip.
        mounted_on: Name of the frame it is mounted on.
        offset: The tip in the frame `mounted_on`, (3,) [m].
        mass: [kg].
    """

    frame: str
    mounted_on: str
    offset: NDArray[np.float64]
    mass: float


@dataclass(frozen=True)
class RobotSpec:
    """A robot described in SI units; arrays are in the order of the model's joints.

    Attributes:
        name: Short name, as given to `load_robot`.
        title: Name for people.
        folder: Folder of the model file.
        model_path: MJCF or URDF file, robot only.
        joint_names: One a joint, base to tip.
        lower: Lower position limits, (n,) [rad].
        upper: Upper position limits, (n,) [rad].
        max_velocity: Speed limits, (n,) [rad/s].
        max_acceleration: Acceleration limits, (n,) [rad/s^2].
        home: A pose to start from, (n,) [rad].
        frames: Frame name -> name of a site, body or link of the model.
        wire_frames: Start and end frame of each segment of the wire model.
        tool: The mounted tool, if there is one.
        dh: Standard Denavit-Hartenberg table, columns theta, d, a, alpha, (n, 4) [rad, m, m, rad], or None.
        dh_frames: Names of the n + 1 frames of the table, or empty.
        spots_path: File of distance sensors, or None where there is none.
        manufacturer: Who makes it.
    """

    name: str
    title: str
    folder: Path
    model_path: Path
    joint_names: tuple[str, ...]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    max_velocity: NDArray[np.float64]
    max_acceleration: NDArray[np.float64]
    home: NDArray[np.float64]
    frames: dict[str, str]
    wire_frames: tuple[tuple[str, str], ...]
    tool: Tool | None = None
    dh: NDArray[np.float64] | None = None
    dh_frames: tuple[str, ...] = field(default=())
    spots_path: Path | None = None
    manufacturer: str = ""
