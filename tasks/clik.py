"""Closed-loop inverse kinematics of tasks on a pose in one compiled call; by the task's own methods elsewhere."""

from __future__ import annotations

from math import atan2, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, Vector, dot, entry, inline, scale
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut, place

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState

_FLOAT = np.dtype(np.float64)


class Clik(NamedTuple):
    """What a task asks for at one instant: J q̇ = ẋ.

    Attributes:
        jacobian: J (rows, n).
        velocity: ẋ = ẋ_d + K e (rows,).
        error: e (rows,).
    """

    jacobian: NDArray[np.float64]
    velocity: NDArray[np.float64]
    error: NDArray[np.float64]


def is_plain(pose: Any, twist: Any) -> bool:
    """Whether compiled code may take a reference pose and twist as they are: arrays of float64, of their shapes."""
    return (
        type(pose) is type(twist) is np.ndarray
        and pose.dtype == twist.dtype == _FLOAT
        and pose.shape == (4, 4)
        and twist.shape == (6,)
    )


def pose_clik(state: RobotState, frame: str, rows: Index, gain: float, sample: Any) -> Clik | None:
    """CLIK of rows of the pose of a frame, e = (x_d - x, log(R_d Rᵀ)) in world axes.

    Args:
        state: Commanded configuration.
        frame: Frame that is controlled.
        rows: Which of x, y, z, and the rotation about x, y, z.
        gain: K [1/s].
        sample: Reference pose and twist.

    Returns:
        None where the sample is not made of plain arrays.
    """
    pose, twist = sample.pose, sample.twist
    if not is_plain(pose, twist):
        return None
    robot = state.robot
    J, result = np.empty((len(rows), robot.nq)), np.empty((2, len(rows)))
    _pose_clik(
        state.memory,
        robot.tree.supports,
        robot.ends,
        *robot.mounting(frame),
        rows,
        gain,
        np.array(pose, order="C"),
        np.array(twist),
        J,
        result,
    )
    return Clik(J, result[0], result[1])


@inline
def rotation_vector(R: tuple[Vector, Vector, Vector]) -> Vector:
    """log R, by the quaternion (w, v) of R, w >= 0: angle 2 atan2(|v|, w) about v; digits are kept at every angle."""
    xx, yy, zz = R[0][0], R[1][1], R[2][2]
    # the largest of 4w², 4x², 4y², 4z² is at least 1
    if xx + yy + zz >= 0.0:
        w, v = 1.0 + xx + yy + zz, (R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1])
    elif xx >= yy and xx >= zz:
        w, v = R[2][1] - R[1][2], (1.0 + xx - yy - zz, R[0][1] + R[1][0], R[0][2] + R[2][0])
    elif yy >= zz:
        w, v = R[0][2] - R[2][0], (R[0][1] + R[1][0], 1.0 + yy - xx - zz, R[1][2] + R[2][1])
    else:
        w, v = R[1][0] - R[0][1], (R[0][2] + R[2][0], R[1][2] + R[2][1], 1.0 + zz - xx - yy)
    if w < 0.0:
        w, v = -w, scale(-1.0, v)
    size = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return scale(2.0 * atan2(size, w) / size if size > 1e-300 else 2.0 / w, v)


@inline
def _row3(T: Array, a: int) -> Vector:
    return T[a, 0], T[a, 1], T[a, 2]


@inline
def _turned(B: Array, a: int, P: Array) -> Vector:
    """Row a of the rotation of B P."""
    return (
        B[a, 0] * P[0, 0] + B[a, 1] * P[1, 0] + B[a, 2] * P[2, 0],
        B[a, 0] * P[0, 1] + B[a, 1] * P[1, 1] + B[a, 2] * P[2, 1],
        B[a, 0] * P[0, 2] + B[a, 1] * P[1, 2] + B[a, 2] * P[2, 2],
    )


@inline
def pose_rows(
    poses: Array, twists: Array, support: Array, body: int, placement: Array, rows: Index, gain: float, goal: Array,
    twist: Array, J: Array, velocity: Array, error: Array,
) -> None:  # fmt: skip
    """Rows of e = (x_d - x, log(R_d Rᵀ)), of ẋ_d + K e and of the Jacobian, for a frame on a body."""
    B, P = poses[body], placement
    # the frame's place x and axes R in the world, by rows
    x = place(B, P[0, 3], P[1, 3], P[2, 3])
    r0, r1, r2 = _turned(B, 0, P), _turned(B, 1, P), _turned(B, 2, P)
    d0, d1, d2 = _row3(goal, 0), _row3(goal, 1), _row3(goal, 2)
    turn = rotation_vector(
        (
            (dot(d0, r0), dot(d0, r1), dot(d0, r2)),
            (dot(d1, r0), dot(d1, r1), dot(d1, r2)),
            (dot(d2, r0), dot(d2, r1), dot(d2, r2)),
        )
    )
    e = (goal[0, 3] - x[0], goal[1, 3] - x[1], goal[2, 3] - x[2], turn[0], turn[1], turn[2])
    for i in range(rows.shape[0]):
        c = rows[i]
        error[i] = e[c]
        velocity[i] = twist[c] + gain * e[c]
        a, b = (c + 1) % 3, (c + 2) % 3
        for j in range(twists.shape[1]):
            # linear rows: v + ω × x; angular rows: ω
            if c < 3:
                J[i, j] = support[j] * (twists[c, j] + twists[3 + a, j] * x[b] - twists[3 + b, j] * x[a])
            else:
                J[i, j] = support[j] * twists[c, j]


_vector = types.Array(types.float64, 1, "C", readonly=True)


@entry(
    types.void(
        _vector, types.Array(types.float64, 2, "C", readonly=True), types.int64, types.int64,
        types.Array(types.float64, 2, "C", readonly=True), types.Array(types.int64, 1, "C", readonly=True),
        types.float64, types.float64[:, ::1], types.float64[::1], types.float64[:, ::1], types.float64[:, ::1],
    ),
    kinematics,
)  # fmt: skip
def _pose_clik(
    memory: Array, supports: Array, k: int, body: int, placement: Array, rows: Index, gain: float,
    goal: Array, twist: Array, J: Array, result: Array,
) -> None:  # fmt: skip
    """Fill J (rows, n) and result (2, rows): velocity, error."""
    poses, twists, _, _ = cut(memory, supports.shape[1], k)
    pose_rows(poses, twists, supports[body], body, placement, rows, gain, goal, twist, J, result[0], result[1])
