"""The danger field of a robot, eqs. (1) to (6) of the paper: how dangerous its motion is for a point in space."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled.compiled import rows
from qpsafe.danger.link_field import danger_field
from qpsafe.danger.vector import danger_vectors
from qpsafe.errors import ConfigurationError
from qpsafe.robot.wire import Wire

_RANGES = {  # attribute: (least, what is expected)
    "static": (0.0, "a finite number >= 0"),
    "kinetic": (0.0, "a finite number >= 0"),
    "gamma": (1.0, "a finite number >= 1, so that the field is never negative"),
    "floor": (math.ulp(0.0), "a finite distance > 0 [m]"),
}

__all__ = ["DangerField", "danger_vectors"]

AT_REST = np.empty((0, 3))  # no velocities: points at rest


@dataclass(frozen=True)
class DangerField:
    """Cumulative danger field CDF of a wire robot, eq. (5), with weights.

    CDF(p) = sum over links of ∫ [ k1 / R + k2 |v_l| (gamma + cos ∠(p - r_l, v_l)) / R² ] dl,  R = |p - r_l|,

    over 0 <= l <= 1, in closed form. Since l is not arc length, a link of length zero counts.

    Evaluation never raises on values: where a point, its velocity or the wire is not finite (a NaN, an infinity, or so
    large that squares overflow), value and gradient of that point are NaN, all of it; a wire that is not finite does so
    to every point. Equal input gives equal bits.

    Attributes:
        static: weight k1 >= 0 of the static field (1); 1 in the paper.
        kinetic: weight k2 >= 0 of the kinetic field (2) [s/m]; 1 in the paper.
        gamma: share of the speed that counts in every direction, in gamma + cos; 1 in the paper. Not below 1, else
            motion away from a point would count as safer than no motion, and the field could be negative.
        floor: a point nearer to a link than this [m] is evaluated at this distance from that link, on the same side;
            a point on the link, on the side that the link moves to. Keeps the field bounded.

    Raises:
        ConfigurationError: a weight or the floor is not a finite number in its range.
    """

    static: float = 1.0
    kinetic: float = 1.0
    gamma: float = 1.0
    floor: float = 1e-3

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            least, expected = _RANGES[field.name]
            try:
                number = float(value)
            except (TypeError, ValueError, OverflowError):
                number = math.nan
            if isinstance(value, str | bool) or not least <= number < math.inf:
                raise ConfigurationError("DangerField", field.name, value, expected)
            object.__setattr__(self, field.name, number)

    def evaluate(
        self, points: ArrayLike, wire: Wire, point_velocities: ArrayLike | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Value and gradient of the field, eq. (5).

        Args:
            points: where to evaluate, (p, 3) [m], world frame; p may be 0.
            wire: the robot's links with their velocities, world frame.
            point_velocities: (p, 3) [m/s], world frame; the links' velocities relative to them count. At rest if None.

        Returns:
            CDF (p,), and its gradient with respect to the point, (p, 3) [1/m].

        Raises:
            ConfigurationError: an array has a wrong shape.
        """
        p = rows(points, "points", None)
        moving = AT_REST if point_velocities is None else rows(point_velocities, "point_velocities", len(p))
        r0, r1, v0, v1 = wire
        r0 = rows(r0, "wire.starts", None)
        r1 = rows(r1, "wire.ends", len(r0))
        v0 = rows(v0, "wire.start_velocities", len(r0))
        v1 = rows(v1, "wire.end_velocities", len(r0))
        value, gradient = np.empty(len(p)), np.empty((len(p), 3))
        self.fill(p, moving, Wire(r0, r1, v0, v1), value, gradient)
        return value, gradient

    def fill(self, points: NDArray[np.float64], moving: NDArray[np.float64], wire: Wire, value: NDArray[np.float64],
             gradient: NDArray[np.float64]) -> None:  # fmt: skip
        """`evaluate` of arrays that are known to fit, into others.

        Args:
            points: (p, 3) [m].
            moving: Their velocities (p, 3) [m/s], or (0, 3) at rest.
            wire: The robot's links.
            value: Filled with CDF (p,), eq. (5).
            gradient: Filled with its gradient (p, 3) [1/m].
        """
        weights = (self.static, self.kinetic, self.gamma)
        danger_field(points, moving, *wire, weights, self.floor, value, gradient)

    def value(self, points: ArrayLike, wire: Wire, point_velocities: ArrayLike | None = None) -> NDArray[np.float64]:
        """CDF (p,), eq. (5); arguments as for `evaluate`.

        Args:
            points: Detected points p, (p, 3) [m].
            wire: The robot's segments and their velocities.
            point_velocities: As for `evaluate`; at rest by default.
        """
        return self.evaluate(points, wire, point_velocities)[0]

    def vectors(self, points: ArrayLike, wire: Wire, point_velocities: ArrayLike | None = None) -> NDArray[np.float64]:
        """Vector field (p, 3), eq. (6), zero where the gradient is; arguments as for `evaluate`.

        Args:
            points: Detected points p, (p, 3) [m].
            wire: The robot's segments and their velocities.
            point_velocities: As for `evaluate`; at rest by default.
        """
        return danger_vectors(*self.evaluate(points, wire, point_velocities))
