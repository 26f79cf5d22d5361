"""Orientation of a frame: the source's low-priority task."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qpsafe.tasks.rotation import log3
from qpsafe.tasks.task import Task
from qpsafe.tasks.trajectory import Sample, Trajectory


class OrientationTask(Task):
    """Keep the orientation of a frame on its trajectory: e = rotation vector of R_d Rᵀ, world frame [rad].

    The rotation vector has no representation singularity below a half turn, unlike the source's Euler angles.

    Args:
        frame: Frame whose orientation is controlled.
        trajectory: Where it should be.
        gain: K_L [1/s]; the source used 10.
    """

    rows = (3, 4, 5)
    name = "orientation"

    def __init__(self, frame: str, trajectory: Trajectory, gain: float = 10.0) -> None:
        super().__init__(frame, trajectory, gain)

    def error(self, pose: NDArray[np.float64], sample: Sample) -> NDArray[np.float64]:
        """log(R_d Rᵀ) (3,) [rad]."""
        return log3(sample.pose[:3, :3] @ pose[:3, :3].T)
