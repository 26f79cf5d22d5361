"""Pose of a frame, whole or in part, in the world or as seen from another frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.tasks.rotation import log3
from qpsafe.tasks.task import Misfit, PoseTask
from qpsafe.tasks.trajectory import Sample, Trajectory
from qpsafe.text.words import call

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState

ALL = (0, 1, 2, 3, 4, 5)


class FrameTask(PoseTask):
    """Keep the pose of a frame, or some rows of it, on a trajectory: the paper picks rows of J_ee in the same way.

    e = (x_d - x, log(R_d Rᵀ)) in world axes [m, rad]. A single angular row means what it seems to mean only while the
    other angles are small.

    Args:
        frame: Frame that is controlled.
        trajectory: Where it should be.
        gain: K [1/s].
        rows: Which of x, y, z, then the rotation about x, y, z, in increasing order, from 0.

    Raises:
        ConfigurationError: Invalid rows, or a bad gain.
    """

    name = "frame"

    def __init__(self, frame: str, trajectory: Trajectory, gain: float = 1.0, rows: Sequence[int] = ALL) -> None:
        self.__dict__["rows"] = rows  # checked next
        super().__init__(frame, trajectory, gain)

    def __repr__(self) -> str:
        return call(self, *self.frames, self.trajectory, gain=self.gain, rows=self.rows)

    def error(self, value: NDArray[np.float64], sample: Sample) -> NDArray[np.float64]:
        """Rows of (x_d - x, log(R_d Rᵀ)), (rows,) [m, rad]."""
        shift = sample.pose[:3, 3] - value[:3, 3]
        return np.concatenate((shift, log3(sample.pose[:3, :3] @ value[:3, :3].T)))[self._rows]

    clik = PoseTask.compiled_clik


class RelativeFrameTask(FrameTask):
    """Keep a frame on a trajectory that is given in another frame of the robot, e.g. the tool as seen from the elbow.

    Args:
        frame: Frame that is controlled.
        base: Frame in whose axes, and from whose origin, everything is measured.
        trajectory: Where `frame` should be, as seen from `base`.
        gain: K [1/s].
        rows: As in `FrameTask`, in the axes of `base`.
    """

    fixed = FrameTask.fixed | {"base"}
    name = "relative frame"

    def __init__(
        self, frame: str, base: str, trajectory: Trajectory, gain: float = 1.0, rows: Sequence[int] = ALL
    ) -> None:
        self.frames = (frame, base)
        super().__init__(frame, trajectory, gain, rows)
        self.base = base

    def value(self, state: RobotState) -> NDArray[np.float64]:
        """Pose of the frame in the axes of `base` (4, 4) [m]."""
        base, pose = state.pose(self.base), state.pose(self.frame)
        relative = np.eye(4)
        relative[:3, :3] = base[:3, :3].T @ pose[:3, :3]
        relative[:3, 3] = base[:3, :3].T @ (pose[:3, 3] - base[:3, 3])
        return relative

    def jacobian(self, state: RobotState) -> NDArray[np.float64]:
        """R_bᵀ (v - v_b - ω_b x (p - p_b)) and R_bᵀ (ω - ω_b) as rows over q̇, (rows, n)."""
        J, J_b = state.jacobian(self.frame), state.jacobian(self.base)
        R = state.rotation(self.base)
        arm = state.position(self.frame) - state.position(self.base)
        linear = J[:3] - J_b[:3] - np.cross(J_b[3:], arm, axisa=0, axisc=0)
        return np.vstack((R.T @ linear, R.T @ (J[3:] - J_b[3:])))[self._rows]

    def misfit(self, robot: Robot) -> Misfit | None:
        """Unknown frames, by the argument that names them."""
        found = super().misfit(robot)
        if found is not None and found.value is not self.frame:
            return found._replace(key="base")
        return found
