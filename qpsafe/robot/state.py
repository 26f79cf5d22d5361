"""One configuration of a robot, its kinematics computed once and asked for cheaply."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from qpsafe.robot.wire import Wire

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


# p @ _SKEW is the matrix of p x, row by row
_SKEW = np.zeros((3, 9))
_SKEW[0, [5, 7]] = -1.0, 1.0
_SKEW[1, [2, 6]] = 1.0, -1.0
_SKEW[2, [1, 3]] = -1.0, 1.0


class RobotState:
    """Kinematics of a robot at one configuration; made by [`Robot.at`][qpsafe.robot.robot.Robot.at].

    Several states may be alive at the same time (measured and commanded pose): each owns its work space, and gives it
    back to the robot when it is no longer referred to. Every array returned is the caller's own.

    Attributes:
        robot: The robot.
        q: The configuration, (n,) [rad], read-only.
    """

    __slots__ = ("_data", "_ends", "_jacobians", "_placements", "q", "robot")

    def __init__(self, robot: Robot, q: NDArray[np.float64]) -> None:
        self.robot = robot
        self.q = q
        self._data: Any = robot._borrow()
        self._ends: NDArray[np.float64] | None = None
        self._jacobians: NDArray[np.float64] | None = None
        pin.computeJointJacobians(robot.model, self._data, q)  # forward kinematics included
        pin.updateFramePlacements(robot.model, self._data)
        self._placements = self._data.oMf

    def __del__(self) -> None:
        data = getattr(self, "_data", None)
        if data is not None:
            self.robot._give_back(data)

    def body_poses(self) -> NDArray[np.float64]:
        """Poses in the world of all moving bodies, body i moved by joint i (from 1); 0 is the world, (n + 1, 4, 4)."""
        return np.array([placement.homogeneous for placement in self._data.oMi])

    def pose(self, frame: str) -> NDArray[np.float64]:
        """Pose of a frame in the world, (4, 4) [m]."""
        return self._placements[self.robot.frame_id(frame)].homogeneous

    def position(self, frame: str) -> NDArray[np.float64]:
        """Origin of a frame in the world, (3,) [m]."""
        return self.pose(frame)[:3, 3]

    def rotation(self, frame: str) -> NDArray[np.float64]:
        """Axes of a frame in the world, in columns, (3, 3)."""
        return self.pose(frame)[:3, :3]

    def jacobian(self, frame: str) -> NDArray[np.float64]:
        """Geometric Jacobian of a frame, world axes, three linear rows before three angular ones, (6, n)."""
        index = self.robot.frame_id(frame)
        return pin.getFrameJacobian(self.robot.model, self._data, index, pin.LOCAL_WORLD_ALIGNED)

    def wire(self, qd: ArrayLike) -> Wire:
        """Segments of the wire model and the velocities of their ends at joint velocities qd, eq. (4).

        Args:
            qd: Joint velocities, (n,) [rad/s].

        Returns:
            One row a segment, in the order of `robot.wire_frames`.

        Raises:
            ConfigurationError: qd has the wrong shape.
        """
        qd = self.robot.joint_vector(qd, "qd")
        ends = self._wire_ends()
        velocities = self.wire_jacobians() @ qd
        starts, stops = self.robot.wire_indices
        return Wire(ends[starts], ends[stops], velocities[starts], velocities[stops])

    def wire_jacobians(self) -> NDArray[np.float64]:
        """Linear Jacobians of the frames that end segments of the wire, (k, 3, n), as in `robot.wire_end_frames`.

        Eq. (14) needs them at both ends of each link: rows ``robot.wire_indices[0]`` and ``[1]`` of this array.
        Computed once a state and read-only.
        """
        if self._jacobians is None:
            linear, angular = self._data.J[:3], self._data.J[3:]  # joint axes' twists at the world's origin
            skew = (self._wire_ends() @ _SKEW).reshape(-1, 3, 3)  # p x
            jacobians = (linear - skew @ angular) * self.robot.wire_support  # v(p) = v(0) - p x omega
            jacobians.flags.writeable = False
            self._jacobians = jacobians
        return self._jacobians

    def _wire_ends(self) -> NDArray[np.float64]:
        if self._ends is None:
            self._ends = np.array([self._placements[index].homogeneous[:3, 3] for index in self.robot.wire_end_ids])
        return self._ends
