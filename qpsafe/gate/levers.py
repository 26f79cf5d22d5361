"""How far a joint can move what hangs on it: bounds that hold in every configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.sensing.detection import SLIDING_EXCESS

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]


def levers(robot: Robot, body: int, points: Array) -> Array:
    """Largest speed of points of a body per unit speed of each joint, whatever the configuration (n,) [m/rad, 1].

    A revolute joint j moves a point at most by its distance from the joint's axis: that of the next joint's origin on
    the way to the body, measured across the axis, then the lengths from origin to origin, then to the point.

    Args:
        robot: The robot.
        body: Of its tree.
        points: In the body's frame (p, 3) [m].
    """
    tree, n = robot.tree, robot.nq
    chain: list[int] = []  # joints from the body down to the base
    at = body
    while at > 0:
        chain.append(at - 1)
        at = int(tree.parents[at - 1])
    result = np.zeros(n)
    beyond = 0.0  # from the origin of the body above joint j's to the farthest point
    above: int | None = None
    for j in chain:
        linear, angular = tree.axes[j, :3], tree.axes[j, 3:]
        speed = float(np.linalg.norm(linear))
        if above is None:
            far = _across(points, angular) if angular.any() else np.zeros(1)
            reach = float(np.linalg.norm(points, axis=1).max())
        else:
            step = tree.placements[above, :3, 3][None]
            far = _across(step, angular) + beyond if angular.any() else np.zeros(1)
            reach = float(np.linalg.norm(step)) + beyond
        result[j] = speed + float(far.max())
        out = max(abs(float(robot.lower[j])), abs(float(robot.upper[j]))) + SLIDING_EXCESS  # where it is believed to be
        slides = speed * out if speed else 0.0
        beyond, above = reach + slides, j
    return result


def _across(points: Array, axis: Array) -> Array:
    """Distances of points (p, 3) from an axis through the origin, unit vector (3,)."""
    return np.linalg.norm(points - np.outer(points @ axis, axis), axis=1)
