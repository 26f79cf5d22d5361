"""A task: a frame, the trajectory it should follow, and its closed-loop inverse kinematics (CLIK)."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.tasks.trajectory import Sample, Trajectory

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState


class Task(ABC):
    """Something the robot is asked to do, at one priority.

    CLIK (section IV-B.4): ẋ = ẋ_d + K e, closed on the commanded configuration.

    Args:
        frame: Frame of the robot that is to follow the trajectory.
        trajectory: Where it should be.
        gain: K [1/s]; 0 < K dt < 1 for a stable discrete loop.

    Raises:
        ConfigurationError: The gain is not a positive finite number.
    """

    #: Rows of the geometric Jacobian that the task uses, linear before angular.
    rows: tuple[int, ...]
    #: Name shown in reports.
    name: str

    def __init__(self, frame: str, trajectory: Trajectory, gain: float) -> None:
        if not (math.isfinite(gain) and gain > 0.0):
            raise ConfigurationError(type(self).__name__, "gain", gain, "a finite number > 0 [1/s]")
        self.frame = frame
        self.trajectory = trajectory
        self.gain = float(gain)
        first, last = self.rows[0], self.rows[-1]
        contiguous = self.rows == tuple(range(first, last + 1))
        self._rows = slice(first, last + 1) if contiguous else list(self.rows)  # a slice is the quicker one

    @abstractmethod
    def error(self, pose: NDArray[np.float64], sample: Sample) -> NDArray[np.float64]:
        """Error e (rows,) from the actual pose (4, 4) to the sample; zero when the task is met."""

    def jacobian(self, state: RobotState) -> NDArray[np.float64]:
        """Task Jacobian (rows, n): the time derivative of what the task controls."""
        return state.jacobian(self.frame)[self._rows]

    def velocity(self, error: NDArray[np.float64], sample: Sample) -> NDArray[np.float64]:
        """CLIK velocity ẋ = ẋ_d + K e, (rows,)."""
        return sample.twist[self._rows] + self.gain * error
