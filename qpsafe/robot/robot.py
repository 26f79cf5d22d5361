"""The robot as the controller sees it: joints with limits, frames with poses and Jacobians, and a wire model."""

from __future__ import annotations

import os
from collections.abc import Mapping
from copy import copy
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.robot.kinematics import tree_of
from qpsafe.robot.models.mjcf import ENDLESS
from qpsafe.robot.robot_file.spec import HeldJoint, Region, RobotSpec, Tool, Tuned
from qpsafe.robot.state import RobotState
from qpsafe.robot.wire import Wire
from qpsafe.text.given import numbers
from qpsafe.text.words import counted

_FLOAT = np.dtype(np.float64)


class Robot(Fixed):
    """Kinematics and limits of one robot; SI units, world frame = the model's world. It does not change.

    A joint that slides has metres where one that turns has radians.

    Make one with `load_robot`. In a loop, call `at` once a tick
    and ask the state.

    Attributes:
        name: Short name.
        title: Name to show.
        folder: Folder of its files.
        model_path: Its MJCF or URDF file.
        nq: Number of joints, n.
        joint_names: (n,) names, base to tip.
        lower: Lower position limits, (n,) [rad], read-only like all arrays here.
        upper: Upper position limits, (n,) [rad].
        max_velocity: Speed limits, (n,) [rad/s].
        max_acceleration: Acceleration limits, (n,) [rad/s^2].
        home: Pose to start from, (n,) [rad].
        sliding: Which joints slide, (n,).
        endless: Which joints turn without end; joint tasks take the short way there, (n,).
        frame_names: Names that `pose` and `jacobian` accept.
        wire_frames: Start and end frame of each segment of the wire model.
        wire_end_frames: The different frames in `wire_frames`, base to tip.
        wire_indices: Places of the segments' start and end frames in `wire_end_frames`, two (links,) arrays.
        ends: How many these are, k.
        tree: The joints as compiled code sees them, taken from the model.
        memory: Floats in the kinematics of one configuration.
        tools: The mounted tools, one per arm.
        tool: The first of them, or None.
        tool_frames: Frames at the tips of the tools; the ends of the wire where no tool is named.
        chains: Published Denavit-Hartenberg tables, one per arm.
        dh: The table (theta, d, a, alpha) of a robot with one, (n, 4), or None.
        dh_frames: Names of the frames of that table.
        danger: (Δ, ε) and (Δ_f, ε_f) as the robot's file states them, or None.
        tuned: Other parameters of a controller that its file states, see `qpsafe tune`.
        parameters: "robot", or "paper" where it was asked to leave out what its file states of these.
        notes: What is missing or doubtful in the robot's files, in words; empty if all is well.
        spots_path: File of the distance sensors, or None where there is none.
        regions: Parts of the surface that may carry distance sensors.
        hulls: Reads the hulls of the collision geometry; use `qpsafe.sensing.body`, which keeps them.
        model: The pinocchio model.
    """

    def __init__(self, spec: RobotSpec, model: Any) -> None:
        self.name = spec.name
        self.title = spec.title
        self.manufacturer = spec.manufacturer
        self.folder: Path = spec.folder
        self.model_path: Path = spec.model_path
        self.spots_path: Path | None = spec.spots_path
        self.regions: tuple[Region, ...] = spec.regions
        self.external_joints: tuple[str, ...] | None = spec.external_joints
        self.model = model
        self.nq: int = model.nq
        self.joint_names = spec.joint_names
        self.lower = _read_only(spec.lower)
        self.upper = _read_only(spec.upper)
        self.max_velocity = _read_only(spec.max_velocity)
        self.max_acceleration = _read_only(spec.max_acceleration)
        self.home = _read_only(spec.home)
        self.tools: tuple[Tool, ...] = spec.tools
        self.tool: Tool | None = spec.tools[0] if spec.tools else None
        self.tool_frames = tuple(tool.frame for tool in spec.tools) or _tips(spec.wire_frames)
        self.chains = spec.chains
        for value in (value for part in (*spec.chains, *spec.regions, *spec.tools) for value in part):
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        self.dh = _read_only(spec.chains[0].table) if len(spec.chains) == 1 else None
        self.dh_frames = spec.chains[0].frames if len(spec.chains) == 1 else ()
        self.danger = spec.danger
        self.tuned: Tuned = spec.tuned
        self.parameters = "robot"
        self.notes = spec.notes
        self._held = spec.held
        self.hulls = spec.hulls
        self.frame_names = tuple(spec.frames)
        self._frame_ids = {name: int(model.getFrameId(target)) for name, target in spec.frames.items()}
        self.wire_frames = spec.wire_frames
        self.wire_end_frames = tuple(dict.fromkeys(name for pair in spec.wire_frames for name in pair))
        place = {name: index for index, name in enumerate(self.wire_end_frames)}
        starts = np.array([place[start] for start, _ in spec.wire_frames], dtype=np.intp)
        stops = np.array([place[stop] for _, stop in spec.wire_frames], dtype=np.intp)
        self.wire_indices = (starts, stops)
        self.ends = len(self.wire_end_frames)
        self.tree = tree_of(model, tuple(self._frame_ids[name] for name in self.wire_end_frames))
        for array in (*self.wire_indices, *self.tree):  # compiled code has copies of them
            array.flags.writeable = False
        self.memory = self.tree.memory
        self.sliding: NDArray[np.bool_] = ~np.any(self.tree.axes[:, 3:], axis=1)
        self.endless: NDArray[np.bool_] = ~self.sliding & (self.upper - self.lower >= 2.0 * ENDLESS - 1e-3)
        frames = {name: model.frames[index] for name, index in self._frame_ids.items()}
        self._mountings = {
            name: (int(frame.parentJoint), _read_only(frame.placement.homogeneous)) for name, frame in frames.items()
        }

    @property
    def held(self) -> Mapping[str, HeldJoint]:
        """Joints of the model file that are held in place, and where."""
        return MappingProxyType(dict(self._held))

    def __repr__(self) -> str:
        size = f"{counted(self.nq, 'joint')}, {counted(len(self.wire_frames), 'wire link')}"
        return f"Robot({self.name!r}, {size}, {self.model_path.name})"

    def with_parameters(self, parameters: str) -> Robot:
        """The same robot with the parameters of its file, or with none of them.

        Args:
            parameters: "robot": itself. "paper": the paper's thresholds, carried over by the rule of
                `qpsafe.danger.thresholds`; evasion, recovery, sensing and gate as where a file states none.
        """
        if parameters not in ("robot", "paper"):
            raise ConfigurationError("load_robot", "parameters", parameters, '"robot" or "paper"')
        if parameters == "robot" or self.parameters == "paper":
            return self
        other = copy(self)
        other.__dict__ |= {"danger": None, "tuned": Tuned(), "parameters": "paper"}
        return other

    def with_spots(self, file: str | Path | None) -> Robot:
        """The same robot with the distance sensors of another file.

        Args:
            file: A name in the robot's folder, or a path. Read, and checked, when its spots are loaded. None for none.
        """
        other = copy(self)
        path = None if file is None else self.folder / file
        if path is not None and not os.path.isfile(path):  # no error for names that no system can have
            path = Path(file).absolute()  # type: ignore[arg-type]
        other.__dict__["spots_path"] = path
        return other

    def at(self, q: ArrayLike) -> RobotState:
        """Kinematics at configuration q, computed once.

        Args:
            q: Joint positions, (n,) [rad]. Not checked against the limits: a measured robot may be anywhere.

        Returns:
            A state of its own; states made later do not change it.

        Raises:
            ConfigurationError: q has the wrong shape.
        """
        own = self.joint_vector(q, "q").copy()
        own.flags.writeable = False
        return RobotState(self, own)

    def pose(self, frame: str, q: ArrayLike) -> NDArray[np.float64]:
        """Pose of a frame in the world at q, (4, 4) [m]. Raises ConfigurationError on an unknown frame."""
        return self.at(q).pose(frame)

    def jacobian(self, frame: str, q: ArrayLike) -> NDArray[np.float64]:
        """Geometric Jacobian of a frame at q, world axes, linear rows first, (6, n).

        Raises:
            ConfigurationError: Unknown frame, or q of the wrong shape.
        """
        return self.at(q).jacobian(frame)

    def wire(self, q: ArrayLike, qd: ArrayLike) -> Wire:
        """Segments of the wire model and the velocities of their ends, eq. (4), each (links, 3) [m, m/s]."""
        return self.at(q).wire(qd)

    def nearest(self, goal: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
        """Joint positions that mean the same as `goal` and are nearest to q: whole turns less on endless joints, (n,).

        A `JointMove` to them takes the short way.

        Raises:
            ConfigurationError: goal or q has the wrong shape.
        """
        there, here = self.joint_vector(goal, "goal"), self.joint_vector(q, "q")
        turns = np.round((there - here) / (2.0 * np.pi))
        return there - np.where(self.endless, 2.0 * np.pi * turns, 0.0)

    def frame_id(self, frame: str) -> int:
        """pinocchio's index of a frame.

        Raises:
            ConfigurationError: There is no such frame; the message lists those there are.
        """
        try:
            return self._frame_ids[frame]
        except (KeyError, TypeError):
            raise self._no_frame(frame) from None

    def mounting(self, frame: str) -> tuple[int, NDArray[np.float64]]:
        """The body a frame sits on, numbered as in `RobotState.body_poses`, and its pose on that body (4, 4) [m].

        Raises:
            ConfigurationError: There is no such frame; the message lists those there are.
        """
        try:
            return self._mountings[frame]
        except (KeyError, TypeError):
            raise self._no_frame(frame) from None

    def joint_vector(self, values: ArrayLike, key: str) -> NDArray[np.float64]:
        """A float64 array of one value per joint, (n,).

        Raises:
            ConfigurationError: Wrong shape, or no real numbers: text, masked or truth values.
        """
        if type(values) is np.ndarray and values.dtype == _FLOAT and values.shape == (self.nq,):  # the usual case
            return values
        expected = f"{self.nq} numbers, one a joint"
        array = numbers(f"robot {self.name}", key, values, expected)
        if array.shape != (self.nq,):
            raise ConfigurationError(f"robot {self.name}", key, values, expected)
        return array

    def _no_frame(self, frame: object) -> ConfigurationError:
        return ConfigurationError(f"robot {self.name}", "frame", frame, "one of " + ", ".join(self.frame_names))


def _tips(wire: tuple[tuple[str, str], ...]) -> tuple[str, ...]:
    """Frames at which links end and none begins."""
    starts = {start for start, _ in wire}
    return tuple(dict.fromkeys(end for _, end in wire if end not in starts))


def _read_only(values: ArrayLike) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array
