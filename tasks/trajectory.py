"""References over time: where a pose or the joints should be, and how fast they should move."""

from __future__ import annotations

from math import isfinite
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.tasks.offset import displaced, offset_of
from qpsafe.tasks.rotation import is_rotation, log3
from qpsafe.text.given import numbers
from qpsafe.text.words import call

#: Squares of larger numbers, and sums of them, could not be computed with.
MOST = 1e100


class Sample(NamedTuple):
    """A reference pose at one instant.

    Attributes:
        pose: x_d as a homogeneous matrix (4, 4), world frame [m].
        twist: ẋ_d (6,), world frame, linear rows [m/s] before angular [rad/s].
    """

    pose: NDArray[np.float64]
    twist: NDArray[np.float64]

    def __repr__(self) -> str:
        return call(self, position=self.pose[:3, 3], rotation=log3(self.pose[:3, :3]), twist=self.twist)

    @property
    def finite(self) -> bool:
        """Whether the reference can be followed at all: its squares sum up to a finite number."""
        return isfinite(np.vdot(self.pose, self.pose) + np.vdot(self.twist, self.twist))

    def slowed(self, rate: float) -> Sample:
        """The same reference on a clock that runs `rate` times as fast."""
        return Sample(self.pose, rate * self.twist)

    def offset(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far a pose is from the reference: shift, then rotation vector, world axes (6,) [m, rad]."""
        return offset_of(value, self.pose)

    def displaced(self, offset: NDArray[np.float64], rate: NDArray[np.float64]) -> Sample:
        """The reference moved by an offset (6,) that changes by `rate` (6,) [m/s, rad/s]."""
        return Sample(*displaced(self.pose, self.twist, offset, rate))


class JointSample(NamedTuple):
    """Reference joint positions at one instant.

    Attributes:
        position: q_d (n,) [rad].
        velocity: q̇_d (n,) [rad/s].
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]

    def __repr__(self) -> str:
        return call(self, self.position, velocity=self.velocity)

    @property
    def finite(self) -> bool:
        """Whether the reference can be followed at all."""
        return isfinite(np.vdot(self.position, self.position) + np.vdot(self.velocity, self.velocity))

    def slowed(self, rate: float) -> JointSample:
        """The same reference on a clock that runs `rate` times as fast."""
        return JointSample(self.position, rate * self.velocity)

    def offset(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far joint positions are from the reference (n,) [rad]."""
        return value - self.position

    def displaced(self, offset: NDArray[np.float64], rate: NDArray[np.float64]) -> JointSample:
        """The reference moved by an offset (n,) that changes by `rate` (n,) [rad/s]."""
        return JointSample(self.position + offset, self.velocity + rate)


class Trajectory(Protocol):
    """A reference over time; it keeps no clock, so a clock that stands still pauses it exactly."""

    def sample(self, t: float) -> Any:
        """`Sample` or `JointSample` at time t >= 0 [s] on the tasks' clock, which stands still while suspended."""
        ...


class FixedPose(Fixed):
    """A reference that does not move, as in the paper's first experiment.

    Args:
        pose: Homogeneous matrix (4, 4), world frame.

    Raises:
        ConfigurationError: `pose` is not a homogeneous matrix with a proper rotation.
    """

    fixed = frozenset(("pose",))

    def __init__(self, pose: ArrayLike) -> None:
        self.pose = checked_pose("FixedPose", "pose", pose)
        self._sample = Sample(self.pose, np.zeros(6))
        self._sample.twist.flags.writeable = False

    def __repr__(self) -> str:
        return call(self, position=self.pose[:3, 3], rotation=log3(self.pose[:3, :3]))

    def sample(self, t: float) -> Sample:
        """The same pose at every time, at rest."""
        return self._sample


class FixedJoints(Fixed):
    """Joint positions that do not move.

    Args:
        position: (n,) [rad].

    Raises:
        ConfigurationError: They are not finite numbers.
    """

    fixed = frozenset(("position",))

    def __init__(self, position: ArrayLike) -> None:
        self.position = checked_vector("FixedJoints", "position", position)

    def __repr__(self) -> str:
        return call(self, self.position)

    def sample(self, t: float) -> JointSample:
        """The same positions at every time, at rest."""
        return JointSample(self.position, np.zeros_like(self.position))


def checked_vector(where: str, key: str, vector: ArrayLike, size: int | None = None) -> NDArray[np.float64]:
    """`vector` as a read-only (n,) array of finite numbers, or a ConfigurationError that says what is wrong.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        vector: As given.
        size: n; any if None.
    """
    expected = f"{'some' if size is None else size} finite numbers, up to {MOST:g}"
    array = numbers(where, key, vector, expected, ndim=1)
    if array.size == 0 or size not in (None, array.size) or not (np.abs(array) <= MOST).all():
        raise ConfigurationError(where, key, vector, expected)
    array.setflags(write=False)
    return array


def checked_pose(where: str, key: str, pose: ArrayLike) -> NDArray[np.float64]:
    """`pose` as a read-only (4, 4) array, or a ConfigurationError that says what is wrong.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        pose: As given.
    """
    expected = "a homogeneous matrix (4, 4) with a proper rotation and last row 0 0 0 1"
    matrix = numbers(where, key, pose, expected, ndim=2)
    if matrix.shape != (4, 4) or not (np.abs(matrix) <= MOST).all():
        raise ConfigurationError(where, key, pose, expected)
    if not is_rotation(matrix[:3, :3]) or not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0), atol=1e-12):
        raise ConfigurationError(where, key, pose, expected)
    matrix.setflags(write=False)
    return matrix
