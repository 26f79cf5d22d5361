"""Position of a frame: the paper's high-priority task."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qpsafe.tasks.task import PoseTask
from qpsafe.tasks.trajectory import Sample, Trajectory


class PositionTask(PoseTask):
    """Keep the origin of a frame on its trajectory: e = x_d - x, world frame [m].

    Args:
        frame: Frame whose origin is controlled.
        trajectory: Where it should be.
        gain: K_H [1/s]; the paper used 1.
    """

    rows = (0, 1, 2)
    name = "position"

    def __init__(self, frame: str, trajectory: Trajectory, gain: float = 1.0) -> None:
        super().__init__(frame, trajectory, gain)

    def error(self, value: NDArray[np.float64], sample: Sample) -> NDArray[np.float64]:
        """x_d - x (3,) [m]."""
        return sample.pose[:3, 3] - value[:3, 3]

    clik = PoseTask.compiled_clik
