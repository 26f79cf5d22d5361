"""How long the levers of a robot's joints are: how much torque a danger at one point causes at most, eq. (15)."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from qpsafe.robot.robot import Robot

CONFIGURATIONS = 32  # that a robot's levers are looked for in

_levers: WeakKeyDictionary[Robot, NDArray[np.float64]] = WeakKeyDictionary()


def levers(robot: Robot) -> NDArray[np.float64]:
    """The longest lever of every joint, from both ends of a link (n,) [m]: how much torque a danger causes at most.

    It is looked for at home and in some configurations of the joints' whole range, once a robot.
    """
    if robot in _levers:
        return _levers[robot]
    starts, stops = robot.wire_indices
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    drawn = np.random.default_rng(0).uniform(lower, upper, (CONFIGURATIONS, robot.nq))
    longest = np.zeros(robot.nq)
    for q in (robot.home, *drawn):
        J = robot.at(q).wire_jacobians()
        longest = np.maximum(longest, np.linalg.norm(J[starts] + J[stops], axis=1).max(axis=0))  # (15)
    longest.flags.writeable = False
    _levers[robot] = longest
    return longest
