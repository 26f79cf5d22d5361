"""A cap on the danger field, beyond the paper: CDF <= Δ_max as a soft level, and an exact speed scaling as last guard.

At fixed q and p, CDF(q̇) = k1 S + k2 H(q̇), where H is convex and positively homogeneous in q̇ (derivations, section 2).
The person's own motion is not in it: the cap holds for what the robot adds.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.field import DangerField
from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.hqp.level import Level
from qpsafe.robot.state import RobotState
from qpsafe.robot.wire import Wire
from qpsafe.text.given import number, whole
from qpsafe.text.words import call

Array = NDArray[np.float64]

_REST = 1e-3  # [rad/s]


class Scaling(NamedTuple):
    """Result of `DangerBarrier.scale`.

    Attributes:
        factor: κ in [0, 1].
        unreachable: Number of points whose static field alone exceeds the cap: no speed helps there, and they do not
            slow the evasive motion that leads away from them.
    """

    factor: float
    unreachable: int


class DangerBarrier(Fixed):
    """Caps the danger field at the detected points.

    Args:
        delta_max: Δ_max, the cap [same unit as CDF].
        horizon: τ, how far ahead the static field is predicted by the soft level [s].
        points: How many of the most dangerous points get a row in the soft level.
        field: The danger field of the controller.

    Raises:
        ConfigurationError: A value is out of range.
    """

    fixed = frozenset(("delta_max", "horizon", "points", "field"))

    def __init__(
        self, delta_max: float, horizon: float = 0.2, points: int = 3, field: DangerField | None = None
    ) -> None:
        self.delta_max = number("DangerBarrier", "delta_max", delta_max, "a finite number > 0", above=0.0)
        self.horizon = number("DangerBarrier", "horizon", horizon, "a finite time >= 0 [s]", 0.0)
        self.points = whole("DangerBarrier", "points", points, "a whole number, at least 1", 1)
        if field is not None and (isinstance(field, type) or not callable(getattr(field, "evaluate", None))):
            raise ConfigurationError("DangerBarrier", "field", field, "a DangerField")
        self.field = DangerField() if field is None else field
        self.__setstate__({})

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Copies, too, compile what they need when they are made, not within the first tick."""
        super().__setstate__(state)
        import qpsafe.danger.kinetic  # noqa: F401

    def __repr__(self) -> str:
        return call(self, self.delta_max, horizon=self.horizon, points=self.points)

    def level(self, state: RobotState, qd: Array, points: Array, danger: Array) -> Level | None:
        """The soft level  k1 (S + τ ∂S/∂q q̇) + k2 ∂H/∂q̇ q̇ <= Δ_max  for the most dangerous points.

        H is replaced by its tangent at the present velocity, exact along it since H is homogeneous.

        Args:
            state: Robot at its present position.
            qd: Present joint velocity (n,) [rad/s].
            points: Detected points (p, 3) [m].
            danger: CDF at the points (p,), to choose by.

        Returns:
            One row per chosen point, or None without points.
        """
        if len(points) == 0:
            return None
        chosen = points[np.argsort(-danger, kind="stable")[: self.points]]
        still = state.wire(np.zeros_like(qd))
        S = self.field.value(chosen, still)  # k1 S
        A = self.horizon * self.static_gradient(state, chosen) + self.kinetic_gradient(state, qd, chosen)
        return Level(A, np.full(len(chosen), -np.inf), self.delta_max - S)

    def static_gradient(self, state: RobotState, points: Array) -> Array:
        """∂(k1 S)/∂q at p points, (p, n).

        A link that moves by its rigid velocity field v(x) changes S as if the point moved by -v(p):
        ∂S/∂q = -Σ_i ∇S_iᵀ J_i(p), with J_i(p) the linear Jacobian of link i's body at the point p.
        """
        n = len(state.q)
        wire = state.wire(np.zeros(n))
        result = np.zeros((len(points), n))
        for i in range(len(wire.starts)):
            one = Wire(*(part[i : i + 1] for part in wire))
            gradient = self.field.evaluate(points, one)[1]
            end = state.robot.wire_frames[i][1]
            J, origin = state.jacobian(end), state.position(end)
            # J_i(p) q̇ = v_end + ω × (p - r_end);  gᵀ (ω × a) = (a × g)ᵀ ω
            result -= gradient @ J[:3] + _cross(points - origin, gradient) @ J[3:]
        return result

    def kinetic_gradient(self, state: RobotState, qd: Array, points: Array) -> Array:
        """∂(k2 H)/∂q̇ at p points, (p, n): Σ over links ∂(k2 H)/∂v_i J_i of both ends; 0 at rest, where H has a kink.

        Args:
            state: Where the robot is.
            qd: Its joint velocity (n,) [rad/s].
            points: (p, 3) [m].
        """
        if np.abs(qd).max() < _REST:
            return np.zeros((len(points), len(qd)))
        wire, (starts, stops), J = state.wire(qd), state.robot.wire_indices, state.wire_jacobians()
        from qpsafe.danger.kinetic import velocity_gradient  # not compiled where there is no barrier

        by_velocity = np.empty((len(points), len(wire.starts), 2, 3))
        velocity_gradient(points, *wire, self.field.kinetic, self.field.gamma, self.field.floor, by_velocity)
        gradient: Array = np.einsum("plc,lcn->pn", by_velocity[:, :, 0], J[starts])
        gradient += np.einsum("plc,lcn->pn", by_velocity[:, :, 1], J[stops])
        return gradient

    def scale(self, state: RobotState, qd: Array, points: Array) -> Scaling:
        """The exact κ = min(1, (Δ_max - k1 S)/(k2 H)) over all points for a commanded velocity.

        Args:
            state: Robot at its present position.
            qd: Commanded joint velocity (n,) [rad/s].
            points: Detected points (p, 3) [m].

        Returns:
            κ; CDF(κ q̇) <= Δ_max at every point whose static field leaves room for it.
        """
        if len(points) == 0:
            return Scaling(1.0, 0)
        S = self.field.value(points, state.wire(np.zeros_like(qd)))  # k1 S
        H = self.field.value(points, state.wire(qd)) - S  # k2 H(q̇)
        room = self.delta_max - S
        reachable = room > 0.0
        too_much = reachable & (room < H)
        factor = float((room[too_much] / H[too_much]).min(initial=1.0))
        return Scaling(factor, int((~reachable).sum()))


def _cross(a: Array, b: Array) -> Array:
    """a × b of rows (p, 3); numpy's own takes twenty times as long for a few."""
    return a[:, _NEXT] * b[:, _LAST] - a[:, _LAST] * b[:, _NEXT]


_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
