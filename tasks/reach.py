"""Can the robot follow a path? Joint positions along it, found step by step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import QpsafeError
from qpsafe.tasks.moves import Line
from qpsafe.tasks.rotation import log3

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: A path is checked this often, or, where it is slow, after this way [s, m, rad].
PERIOD, STRIDE, TURN = 0.02, 0.005, 0.016


class UnreachableError(QpsafeError, ValueError):
    """The robot cannot take a pose, or cannot take it at this speed; the message says why."""


def joints_for(robot: Robot, frame: str, pose: Array, guess: Array, steps: int = 200, tolerance: float = 1e-9) -> Array:
    """Joint positions (n,) at which `frame` has `pose` (4, 4), by damped Gauss-Newton from a guess, inside the limits.

    Args:
        robot: The robot.
        frame: One of its frames.
        pose: Where it should be (4, 4) [m].
        guess: Where to start (n,) [rad].
        steps: How many are tried.
        tolerance: What error of position and orientation is none [m, rad].

    Raises:
        UnreachableError: None was found from this guess.
    """
    q = np.array(guess, dtype=float)
    error = np.full(6, np.inf)
    for _ in range(steps):
        state = robot.at(q)
        here = state.pose(frame)
        error = np.concatenate((pose[:3, 3] - here[:3, 3], log3(pose[:3, :3] @ here[:3, :3].T)))
        if np.abs(error).max() <= tolerance:
            return q
        J = state.jacobian(frame)
        damping = 1e-9 + 1e-2 * float(error @ error)  # small near the goal: there it converges quadratically
        dq = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), error)
        q = np.clip(q + dq / max(1.0, float(np.abs(dq).max()) / 0.3), robot.lower, robot.upper)
    if np.abs(error).max() <= 1e-6:
        return q
    at_limit = [
        name for name, a, b, c in zip(robot.joint_names, q, robot.lower, robot.upper, strict=True) if a in (b, c)
    ]
    reason = f"{', '.join(at_limit)} at a limit" if at_limit else "out of reach"
    shift, turn = 1e3 * np.linalg.norm(error[:3]), np.linalg.norm(error[3:])
    raise UnreachableError(f"{reason}: nearest found is {shift:.1f} mm and {turn:.3f} rad away")


def checked_poses(move: Line) -> int:
    """At how many poses `follow` checks a move: every `PERIOD`, or every `STRIDE` and `TURN` where it is slower.

    A jerk-limited motion is at most twice as fast as on average, hence the factor of 2.
    """
    finest = 2.0 * max(move.length / STRIDE, move.angle / TURN)
    return max(math.ceil(min(move.duration / PERIOD, finest)), 1)


def follow(robot: Robot, frame: str, move: Line, q: Array) -> Array:
    """Joint positions (n,) at the end of a line or an arc that starts at q.

    Args:
        robot: The robot.
        frame: What moves along the line.
        move: A line or an arc.
        q: At its start (n,) [rad].

    Raises:
        UnreachableError: A pose on the way cannot be taken, or some joint would be too fast.
    """
    count = checked_poses(move)
    for k in range(1, count + 1):
        t = move.duration * k / count
        try:
            after = joints_for(robot, frame, move.sample(t).pose, q, steps=30)
        except UnreachableError as problem:
            raise UnreachableError(f"{t:.2f} s on the way, {problem}") from None
        speed = np.abs(after - q) * count / move.duration
        fastest = int((speed / robot.max_velocity).argmax())
        if not speed[fastest] <= robot.max_velocity[fastest]:
            name, limit = robot.joint_names[fastest], robot.max_velocity[fastest]
            raise UnreachableError(f"{t:.2f} s on the way, {name} needs {speed[fastest]:.2f} of {limit:.2f} rad/s")
        q = after
    return q
