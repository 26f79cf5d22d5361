"""Joints on a trajectory of their own, and a posture to come back to where nothing else is asked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.tasks.task import Misfit, Task
from qpsafe.tasks.trajectory import FixedJoints, JointSample, Trajectory
from qpsafe.text.given import parts, whole
from qpsafe.text.words import call, counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState

TURN = 2.0 * np.pi  # [rad]


class JointTask(Task):
    """Keep joints on a trajectory: e = q_d - q [rad], by the short way where a joint turns without end.

    Args:
        trajectory: Of all n joints; its samples are `JointSample`s.
        gain: K [1/s].
        joints: Which joints, from 0; None for all.

    Raises:
        ConfigurationError: Invalid joints, or a bad gain.
    """

    fixed = Task.fixed | {"joints"}
    name = "joint"

    def __init__(self, trajectory: Trajectory, gain: float = 5.0, joints: Sequence[int] | None = None) -> None:
        super().__init__(trajectory, gain)
        self.joints = None if joints is None else _checked_joints(type(self).__name__, joints)
        self._endless: NDArray[np.bool_] | None = None  # of the robot whose value was last asked for

    def __repr__(self) -> str:
        return call(self, self.trajectory, gain=self.gain, joints=self.joints)

    def value(self, state: RobotState) -> NDArray[np.float64]:
        """All joint positions (n,) [rad]."""
        robot = getattr(state, "robot", None)  # what stands in for a state may have no more than q
        self._endless = robot.endless if robot is not None and robot.endless.any() else None
        return state.q

    def error(self, value: NDArray[np.float64], sample: JointSample) -> NDArray[np.float64]:
        """q_d - q of the chosen joints [rad]."""
        error = -self.offset(value, sample)
        return error if self.joints is None else error[list(self.joints)]

    def offset(self, value: NDArray[np.float64], sample: JointSample) -> NDArray[np.float64]:
        """q - q_d of all joints, less whole turns where a joint turns without end [rad]."""
        offset = sample.offset(value)
        if self._endless is None:
            return offset
        return offset - np.where(self._endless, TURN * np.round(offset / TURN), 0.0)

    def jacobian(self, state: RobotState) -> NDArray[np.float64]:
        """Rows of the identity."""
        identity = np.eye(len(state.q))
        return identity if self.joints is None else identity[list(self.joints)]

    def velocity(self, error: NDArray[np.float64], sample: JointSample) -> NDArray[np.float64]:
        """q̇_d + K e of the chosen joints [rad/s]."""
        velocity = sample.velocity if self.joints is None else sample.velocity[list(self.joints)]
        return velocity + self.gain * error

    def misfit(self, robot: Robot) -> Misfit | None:
        """Joints the robot does not have, a trajectory of another number of joints."""
        if self.joints is not None and max(self.joints) >= robot.nq:
            return Misfit("joints", self.joints, f"below {robot.nq}")
        sample = self.trajectory.sample(0.0)
        if not isinstance(sample, JointSample) or sample.position.shape != (robot.nq,):
            return Misfit("trajectory", self.trajectory, f"a trajectory of {counted(robot.nq, 'joint')}")
        return None


def _checked_joints(where: str, joints: Sequence[int]) -> tuple[int, ...]:
    expected = "different whole numbers from 0, or None"
    chosen = tuple(whole(where, "joints", joint, expected, 0) for joint in parts(where, "joints", joints, expected))
    if len(chosen) == 0 or len(set(chosen)) != len(chosen):
        raise ConfigurationError(where, "joints", joints, expected)
    return chosen


class PostureTask(JointTask):
    """Draw all joints to a posture, as far as the tasks above leave freedom; nothing waits for it.

    Args:
        posture: (n,) [rad].
        gain: K [1/s].
    """

    name = "posture"
    essential = False

    def __init__(self, posture: ArrayLike, gain: float = 1.0) -> None:
        super().__init__(FixedJoints(posture), gain)
