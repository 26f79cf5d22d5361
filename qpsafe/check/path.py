"""The nominal path of a program through the joints: where the robot is to be at every tick when nobody is there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.tasks.reach import UnreachableError, joints_for
from qpsafe.tasks.rotation import log3

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.tasks.trajectory import Trajectory

Array = NDArray[np.float64]

MOST = 5_000  # moments of a path; longer ones are looked at less often than at every tick
DAMPING = 1e-9  # of J Jᵀ, so that singular poses have large but finite speeds


class NominalPath(NamedTuple):
    """N moments of a path, at equal steps.

    Attributes:
        frame: Of the robot, that follows the program.
        step: Between two moments [s].
        times: (N,) [s].
        q: (N, n) [rad].
        qd: J⁺ẋ, (N, n) [rad/s].
        qdd: Change of it in a step (N, n) [rad/s²].
        poses: Of the robot's bodies, see `RobotState.body_poses`, (N, n + 1, 4, 4) [m].
        tool: Origin of the frame, (N, 3) [m].
        jacobians: Of the frame, (N, 6, n).
        errors: How far the frame is from where it should be, and how much it is turned, (N, 2) [m], [rad].
        trouble: Why the path ends before the program does; empty if it does not.
    """

    frame: str
    step: float
    times: Array
    q: Array
    qd: Array
    qdd: Array
    poses: Array
    tool: Array
    jacobians: Array
    errors: Array
    trouble: str


def nominal_path(
    robot: Robot, frame: str, reference: Trajectory, duration: float = 0.0, dt: float = 0.004
) -> NominalPath:
    """Follow a reference with the joints, from the pose nearest to the robot's home on.

    Args:
        robot: The robot.
        frame: One of its frames.
        reference: Where that is to be.
        duration: How long [s]; 0 for a pose that is kept.
        dt: Tick [s]; the path is looked at every so many of them that there are at most `MOST` moments.
    """
    step = dt * max(1, math.ceil(duration / (dt * MOST)))
    count = math.ceil(duration / step - 1e-9) + 1
    times = np.minimum(step * np.arange(count), duration)
    n, trouble = robot.nq, ""
    q, qd = np.empty((count, n)), np.empty((count, n))
    poses, tool, jacobians = np.empty((count, n + 1, 4, 4)), np.empty((count, 3)), np.empty((count, 6, n))
    errors = np.empty((count, 2))
    guess, tries = robot.home, 200
    for k, t in enumerate(times.tolist()):
        sample = reference.sample(t)
        try:
            here = joints_for(robot, frame, sample.pose, guess, tries, 1e-6)
        except UnreachableError as problem:
            trouble, count = str(problem), k
            break
        state = robot.at(here)
        pose, J = state.pose(frame), state.jacobian(frame)
        q[k], poses[k], tool[k], jacobians[k] = here, state.body_poses(), pose[:3, 3], J
        turn = log3(sample.pose[:3, :3] @ pose[:3, :3].T)
        errors[k] = np.linalg.norm(sample.pose[:3, 3] - pose[:3, 3]), np.linalg.norm(turn)
        qd[k] = J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), sample.twist)
        guess, tries = here + step * (1.5 * qd[k] - 0.5 * qd[max(k - 1, 0)]), 30
    q, qd = q[:count], qd[:count]
    times = times[:count]
    qdd = np.diff(qd, axis=0, prepend=np.zeros((1, n))) / np.diff(times, prepend=-step)[:, None]
    rest = (poses[:count], tool[:count], jacobians[:count], errors[:count], trouble)
    return NominalPath(frame, step, times, q, qd, qdd, *rest)
