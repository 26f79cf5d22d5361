"""Everything a robot's folder says, in SI units: the one thing a `Robot` is built from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.robot.joint_choice import HeldJoint
from qpsafe.robot.models.hulls import BodyHull

#: What a robot stands in, not on: pinocchio's world, and by custom the link of a URDF that means it.
WORLD = ("universe", "world")


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


class DHChain(NamedTuple):
    """One published kinematic chain.

    Attributes:
        table: Standard Denavit-Hartenberg, columns theta, d, a, alpha, (k, 4) [rad, m, m, rad].
        frames: Names of the k + 1 frames it leads through; the first one stands still.
        joints: Places of the k joints among the robot's.
    """

    table: NDArray[np.float64]
    frames: tuple[str, ...]
    joints: tuple[int, ...]


#: Names and numbers.
Stated = tuple[tuple[str, Any], ...]


class Tuned(NamedTuple):
    """Parameters of a controller that a robot's file states, SI; empty where it leaves them to the defaults.

    Attributes:
        evasion: M, D and friction, all (n,); None for the last where it is left to the rule.
        recovery: Of `RecoveryRules`.
        sensing: Of `SensingRules`.
        gate: Of `VerifiedMotion`.
    """

    evasion: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...] | None] | None = None
    recovery: Stated = ()
    sensing: Stated = ()
    gate: Stated = ()


class Region(NamedTuple):
    """A part of the surface that may carry distance sensors, section III.

    Attributes:
        name: Shown in the names of its sensors.
        link: Wire link that carries them, counted from 0.
        frame: Frame in which the box, and the mesh if there is one, are given.
        lower: Corner of the box, (3,) [m].
        upper: The opposite corner, (3,) [m].
        mesh: File of the surface in that frame; None: that of the body the frame is fixed to, as the model has it.
        scale: Metres in one unit of the mesh file.
        at_most: How many sensors may be put there; None for any number.
        self_sight: Share of random configurations in which a place may see the robot itself from close by.
    """

    name: str
    link: int
    frame: str
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    mesh: Path | None = None
    scale: float = 1.0
    at_most: int | None = None
    self_sight: float = 0.02


@dataclass(frozen=True)
class RobotSpec:
    """A robot described in SI units; arrays are in the order of the model's joints, metres where a joint slides.

    Attributes:
        name: Short name, as given to `load_robot`.
        title: Name to show.
        folder: Folder of the model file.
        model_path: MJCF or URDF file, robot only.
        joint_names: One a joint, base to tip.
        lower: Lower position limits, (n,) [rad].
        upper: Upper position limits, (n,) [rad].
        max_velocity: Speed limits, (n,) [rad/s].
        max_acceleration: Acceleration limits, (n,) [rad/s^2].
        home: Pose to start from, (n,) [rad].
        frames: Frame name -> name of a site, body or link of the model.
        wire_frames: Start and end frame of each segment of the wire model.
        tools: The mounted tools, one an arm; none where the file names none.
        chains: Published Denavit-Hartenberg tables, one an arm; none where the file has none.
        danger: (Δ, ε) and (Δ_f, ε_f) of this robot, or None: then by the rule of `qpsafe.danger.thresholds`.
        tuned: Other parameters that its file states, see `qpsafe tune`.
        notes: What is missing or doubtful in the robot's files, in words.
        spots_path: File of distance sensors, or None where there is none.
        manufacturer: Who makes it.
        regions: Parts of the surface that may carry distance sensors.
        held: Joints of the model file that are held, and where.
        hulls: Reads the hulls of its collision geometry.
        external_joints: Joints that an ABB controller takes for external ones, in its order; None for the usual ones.
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
    tools: tuple[Tool, ...] = ()
    chains: tuple[DHChain, ...] = ()
    danger: tuple[tuple[float, float], tuple[float, float]] | None = None
    tuned: Tuned = field(default_factory=Tuned)
    notes: tuple[str, ...] = ()
    spots_path: Path | None = None
    manufacturer: str = ""
    regions: tuple[Region, ...] = ()
    held: Mapping[str, HeldJoint] = field(default_factory=dict)
    hulls: Callable[[], list[BodyHull]] = list
    external_joints: tuple[str, ...] | None = None
