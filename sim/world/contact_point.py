"""How the point of a robot moves that is nearest to somebody, and how much of that is towards them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState

Array = NDArray[np.float64]


class ContactPoint(NamedTuple):
    """The point of the robot that is nearest to somebody.

    Attributes:
        jacobian: Linear, world axes (3, n).
        velocity: (3,) [m/s].
        normal: Unit vector towards the other (3,).
    """

    jacobian: Array
    velocity: Array
    normal: Array

    @property
    def towards(self) -> float:
        """Speed towards the other [m/s], negative where it goes away."""
        return float(self.velocity @ self.normal)


def contact_point(state: RobotState, qd: Array, body: int, pair: tuple[Array, Array], distance: float) -> ContactPoint:
    """The motion of a point that is nearest to somebody.

    Args:
        state: The robot.
        qd: (n,) [rad/s].
        body: That carries the point, as in the robot's tree.
        pair: Nearest points of robot and other, (3,) each [m].
        distance: Between them, negative where they overlap [m].
    """
    on_robot, on_other = pair
    away = on_other - on_robot
    # where they overlap already, the nearest points lie the other way round
    normal = np.copysign(1.0, distance) * away / max(float(np.linalg.norm(away)), 1e-12)
    J = point_jacobian(state, body, on_robot)
    return ContactPoint(J, J @ qd, normal)


def point_jacobian(state: RobotState, body: int, point: Array) -> Array:
    """Linear Jacobian (3, n) of the point of a body that is at `point` now (3,).

    Args:
        state: Of the robot.
        body: As in its tree, 0 for the base.
        point: (3,) [m].
    """
    n = state.robot.nq
    twists = state.memory[16 * (n + 1) : 16 * (n + 1) + 6 * n].reshape(6, n)
    linear = twists[:3] + np.cross(twists[3:], point, axis=0)  # v + ω × p
    return np.asarray(state.robot.tree.supports[body] * linear)
