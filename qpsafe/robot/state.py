"""One configuration of a robot, its kinematics computed once and asked for cheaply."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.robot.kinematics import Tree, forward, jacobian_of, pose_of, wire_of
from qpsafe.robot.wire import Wire
from qpsafe.text.words import call

Array = NDArray[np.float64]


class Jointed(Protocol):
    """What a state needs of its robot, see `qpsafe.robot.robot.Robot`."""

    nq: int
    ends: int
    memory: int
    tree: Tree
    wire_frames: tuple[tuple[str, str], ...]
    wire_indices: tuple[NDArray[np.intp], NDArray[np.intp]]
    endless: NDArray[np.bool_]

    def mounting(self, frame: str) -> tuple[int, Array]:
        """Body and place on it of a frame."""
        ...

    def joint_vector(self, value: ArrayLike, name: str) -> Array:
        """A checked vector (n,)."""
        ...


class RobotState:
    """Kinematics of a robot at one configuration; made by `Robot.at`.

    Several states may be alive at the same time (measured and commanded pose): each owns its memory. Every array
    returned is the caller's own, or read-only.

    Attributes:
        robot: The robot.
        q: The configuration, (n,) [rad], read-only.
        memory: What `qpsafe.robot.kinematics.forward` computed, for compiled code.
    """

    __slots__ = ("_poses", "memory", "q", "robot")

    def __init__(self, robot: Jointed, q: Array) -> None:
        self.robot = robot
        self.q = q
        self.memory = np.empty(robot.memory)
        self._poses: dict[str, Array] = {}  # asked for before
        forward(q, *robot.tree, self.memory)

    def __repr__(self) -> str:
        return call(self, getattr(self.robot, "name", self.robot), self.q)

    def body_poses(self) -> Array:
        """Poses in the world of all moving bodies, body i moved by joint i (from 1); 0 is the world, (n + 1, 4, 4)."""
        n = self.robot.nq
        return self.memory[: 16 * (n + 1)].reshape(n + 1, 4, 4).copy()

    def pose(self, frame: str) -> Array:
        """Pose of a frame in the world, (4, 4) [m]."""
        try:
            return self._poses[frame].copy()
        except (KeyError, TypeError):  # not asked for before, or no name at all
            robot, pose = self.robot, np.empty((4, 4))
            pose_of(self.memory, robot.tree.supports, robot.ends, *robot.mounting(frame), pose)
            self._poses[frame] = pose
            return pose.copy()

    def position(self, frame: str) -> Array:
        """Origin of a frame in the world, (3,) [m]."""
        return self.pose(frame)[:3, 3]

    def rotation(self, frame: str) -> Array:
        """Axes of a frame in the world, in columns, (3, 3)."""
        return self.pose(frame)[:3, :3]

    def jacobian(self, frame: str) -> Array:
        """Geometric Jacobian of a frame, world axes, three linear rows before three angular ones, (6, n)."""
        robot, J = self.robot, np.empty((6, self.robot.nq))
        jacobian_of(self.memory, robot.tree.supports, robot.ends, *robot.mounting(frame), J)
        return J

    def wire(self, qd: ArrayLike) -> Wire:
        """Segments of the wire model and the velocities of their ends at joint velocities qd, eq. (4).

        Args:
            qd: Joint velocities, (n,) [rad/s].

        Returns:
            One row a segment, in the order of `robot.wire_frames`.

        Raises:
            ConfigurationError: qd has the wrong shape.
        """
        robot = self.robot
        starts, stops = robot.wire_indices
        parts = np.empty((4, len(starts), 3))
        wire_of(self.memory, robot.ends, robot.joint_vector(qd, "qd"), starts, stops, parts)
        return tuple.__new__(Wire, parts)  # without a detour through Python

    def wire_jacobians(self) -> Array:
        """Linear Jacobians of the frames that end segments of the wire, (k, 3, n), as in `robot.wire_end_frames`.

        Eq. (14) needs them at both ends of each link: rows ``robot.wire_indices[0]`` and ``[1]`` of this array.
        Read-only.
        """
        n, k = self.robot.nq, self.robot.ends
        jacobians = self.memory[-3 * k * n :].reshape(k, 3, n)
        jacobians.flags.writeable = False
        return jacobians
