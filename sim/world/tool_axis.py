"""Which way a tool points: out of the flange, in the axes of its own frame, whatever those are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

ALONG = 0.7  # share of the tip's offset that lies along the last joint's axis, from which on that axis is meant


def tool_axis(robot: Robot, frame: str) -> Array:
    """The direction in which a tool points, a unit vector in its frame's axes, (3,).

    Along the axis of the joint that carries it, towards the tip, where the tip lies about there; else from that joint
    to the tip. Within 20 degrees of an axis of the frame it is that axis.
    """
    body, place = robot.mounting(frame)
    offset, axis = place[:3, 3], robot.tree.axes[body - 1]
    joint = axis[3:] if axis[3:].any() else axis[:3]
    far, along = float(np.linalg.norm(offset)), float(offset @ joint)
    if far < 1e-6 or abs(along) >= ALONG * far:
        direction = np.copysign(1.0, along) * joint if far >= 1e-6 else joint
    else:
        direction = offset / far
    found = np.asarray(place[:3, :3].T @ direction)
    nearest = int(np.abs(found).argmax())
    if abs(found[nearest]) > np.cos(np.radians(20.0)):
        found = np.copysign(1.0, found[nearest]) * np.eye(3)[nearest]
    return found


def turned_to(axis: Array, direction: Array) -> Array:
    """The smallest turn (3, 3) that takes a unit vector to another one, (3,) each."""
    v, c = np.cross(axis, direction), float(axis @ direction)
    if c < -1.0 + 1e-9:  # half a turn about anything across
        across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        across /= np.linalg.norm(across)
        return np.asarray(2.0 * np.outer(across, across) - np.eye(3))
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + c))
