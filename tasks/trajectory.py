"""References over time: where a frame should be, as a pose and a twist."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.tasks.rotation import exp3, is_rotation, log3


class Sample(NamedTuple):
    """A reference at one instant.

    Attributes:
        pose: x_d as a homogeneous matrix (4, 4), world frame [m].
        twist: ẋ_d (6,), world frame, linear rows [m/s] before angular [rad/s].
    """

    pose: NDArray[np.float64]
    twist: NDArray[np.float64]


class Trajectory(Protocol):
    """A reference pose over time."""

    def sample(self, t: float) -> Sample:
        """Reference at time t >= 0 [s] on the trajectory's own clock, which stands still while suspended."""
        ...


class FixedPose:
    """A reference that does not move, as in the source's first experiment.

    Args:
        pose: Homogeneous matrix (4, 4), world frame.

    Raises:
        ConfigurationError: `pose` is not a homogeneous matrix with a proper rotation.
    """

    def __init__(self, pose: ArrayLike) -> None:
        self.pose = checked_pose("FixedPose", "pose", pose)

    def sample(self, t: float) -> Sample:
        """The same pose at every time, at rest."""
        return Sample(self.pose, np.zeros(6))


class SmoothMove:
    """Straight move between two poses, at rest at both ends, used to recover (section IV-C).

    Position follows the line, orientation the shortest rotation, both with the minimum-jerk time law
    s(τ) = 10 τ³ - 15 τ⁴ + 6 τ⁵, whose peak speed is 15/8 of the mean.

    Args:
        start: Pose at t = 0, (4, 4).
        goal: Pose at t = duration, (4, 4).
        speed: Peak speed of the origin [m/s].
        angular_speed: Peak angular speed [rad/s].
        minimum_duration: Shortest duration [s], so that small moves stay gentle.
    """

    def __init__(
        self,
        start: NDArray[np.float64],
        goal: NDArray[np.float64],
        speed: float = 0.25,
        angular_speed: float = 0.8,
        minimum_duration: float = 0.4,
    ) -> None:
        self.start, self.goal = start, goal
        self._shift = goal[:3, 3] - start[:3, 3]
        self._turn = log3(goal[:3, :3] @ start[:3, :3].T)  # world frame
        peak = 15.0 / 8.0
        self.duration = max(
            peak * float(np.linalg.norm(self._shift)) / speed,
            peak * float(np.linalg.norm(self._turn)) / angular_speed,
            minimum_duration,
        )

    def sample(self, t: float) -> Sample:
        """Reference at time t [s]; the goal, at rest, from `duration` on."""
        tau = min(max(t / self.duration, 0.0), 1.0)
        s = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
        ds = 30.0 * tau**2 * (1.0 - tau) ** 2 / self.duration
        pose = np.eye(4)
        pose[:3, 3] = self.start[:3, 3] + s * self._shift
        pose[:3, :3] = exp3(s * self._turn) @ self.start[:3, :3]
        return Sample(pose, ds * np.concatenate((self._shift, self._turn)))


def checked_pose(where: str, key: str, pose: ArrayLike) -> NDArray[np.float64]:
    """`pose` as a read-only (4, 4) array, or a ConfigurationError that says what is wrong."""
    expected = "a homogeneous matrix (4, 4) with a proper rotation and last row 0 0 0 1"
    try:
        matrix = np.array(pose, dtype=float)
    except (TypeError, ValueError):
        raise ConfigurationError(where, key, pose, expected) from None
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ConfigurationError(where, key, pose, expected)
    if not is_rotation(matrix[:3, :3]) or not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0), atol=1e-12):
        raise ConfigurationError(where, key, pose, expected)
    matrix.setflags(write=False)
    return matrix
