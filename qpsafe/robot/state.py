"""One configuration of a robot, its kinematics computed once and asked for cheaply."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numba import types
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.compiled import entry, readable
from qpsafe.robot.wire import Wire

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


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
        ends, jacobians = self._wire_ends(), self.wire_jacobians()
        starts, stops = self.robot.wire_indices
        parts = np.empty((4, len(starts), 3))
        _segments(ends, jacobians, qd, starts, stops, parts)
        return Wire(*parts)

    def wire_jacobians(self) -> NDArray[np.float64]:
        """Linear Jacobians of the frames that end segments of the wire, (k, 3, n), as in `robot.wire_end_frames`.

        Eq. (14) needs them at both ends of each link: rows ``robot.wire_indices[0]`` and ``[1]`` of this array.
        Computed once a state and read-only.
        """
        if self._jacobians is None:
            ends = self._wire_ends()
            jacobians = np.empty((len(ends), 3, self.robot.nq))
            _point_jacobians(self._data.J, ends, self.robot.wire_support, jacobians)
            jacobians.flags.writeable = False
            self._jacobians = jacobians
        return self._jacobians

    def _wire_ends(self) -> NDArray[np.float64]:
        if self._ends is None:
            self._ends = np.array([self._placements[index].homogeneous[:3, 3] for index in self.robot.wire_end_ids])
        return self._ends


_places = types.Array(types.int64, 1, "A", readonly=True)


@entry(types.void(readable(2), readable(2), readable(3), types.float64[:, :, ::1]))
def _point_jacobians(J, points, support, result):  # type: ignore[no-untyped-def]
    """Linear Jacobians of points (k, 3) from the joint axes' twists (v, ω) at the world's origin, J (6, n).

    Joint j moves the point p by v + ω × p if it moves the point at all, support (k, 1, n).
    """
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        for j in range(J.shape[1]):
            on = support[k, 0, j]
            result[k, 0, j] = on * (J[0, j] + J[4, j] * z - J[5, j] * y)
            result[k, 1, j] = on * (J[1, j] + J[5, j] * x - J[3, j] * z)
            result[k, 2, j] = on * (J[2, j] + J[3, j] * y - J[4, j] * x)


@entry(types.void(readable(2), readable(3), readable(1), _places, _places, types.float64[:, :, ::1]))
def _segments(ends, jacobians, qd, starts, stops, parts):  # type: ignore[no-untyped-def]
    """Fill parts (4, links, 3): starts, ends, start velocities, end velocities; v = J q̇."""
    for side in range(2):
        places = starts if side == 0 else stops
        for i in range(len(places)):
            for c in range(3):
                velocity = 0.0
                for j in range(len(qd)):
                    velocity += jacobians[places[i], c, j] * qd[j]
                parts[side, i, c] = ends[places[i], c]
                parts[2 + side, i, c] = velocity
