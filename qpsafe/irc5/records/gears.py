"""From the arm side to the motor side and back: explicit, with a type of its own, so that sides cannot be mixed up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.reference import JointReference, ServoGains
from qpsafe.text.given import numbers

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MotorReference:
    """A `JointReference` on the motor side: motor angles and torques instead of those of the joints.

    Attributes:
        seq, time, active: As in the joint reference.
        position: (n,) [rad of the motor].
        velocity: (n,) [rad/s of the motor].
        torque: Feed-forward (n,) [N m at the motor], or None.
        gains: Kp (n,) [1/s], Kv (n,) [N m s/rad at the motor], Ki (n,) [N m/rad at the motor], or None.
    """

    seq: int
    time: float
    position: Array
    velocity: Array
    active: bool = True
    torque: Array | None = None
    gains: ServoGains | None = None


class GearRatios:
    """Motor angles φ = G q + φ0 with G = diag(ratios) + coupling.

    Power is the same on both sides, so that torques follow τ_motor = G⁻ᵀ τ_arm.

    Args:
        ratios: Turns of each motor per turn of its own joint (n,), negative where it turns the other way.
        coupling: What other joints add to a motor's angle (n, n), zero on the diagonal, e.g. in a wrist whose gears
            turn along; none by default.
        offset: Motor angles φ0 where the joints are at zero (n,) [rad]; zero by default.

    Attributes:
        matrix: G (n, n).
        offset: φ0 (n,) [rad].

    Raises:
        ConfigurationError: Shapes do not match, a number is not finite, a ratio is zero, or G cannot be inverted.
    """

    def __init__(self, ratios: ArrayLike, coupling: ArrayLike | None = None, offset: ArrayLike | None = None) -> None:
        ratio = _numbers("ratios", ratios, None)
        n = len(ratio)
        if not (ratio != 0.0).all():
            raise ConfigurationError("GearRatios", "ratios", ratio, "no zero")
        extra = np.zeros((n, n)) if coupling is None else _numbers("coupling", coupling, (n, n))
        if np.diag(extra).any():
            raise ConfigurationError("GearRatios", "coupling", extra, "zeros on the diagonal: ratios has those")
        self.matrix = np.diag(ratio) + extra
        self.offset = np.zeros(n) if offset is None else _numbers("offset", offset, (n,))
        if not np.linalg.cond(self.matrix) < 1e12:
            raise ConfigurationError("GearRatios", "coupling", extra, "a coupling that can be undone")
        self._inverse: Array = np.linalg.inv(self.matrix).astype(np.float64)

    def to_motor(self, reference: JointReference) -> MotorReference:
        """The reference on the motor side.

        Raises:
            ConfigurationError: It has gains, and the gears are coupled so that no gain per motor equals them.
        """
        G, inverse = self.matrix, self._inverse
        torque = None if reference.torque is None else inverse.T @ reference.torque
        gains = None if reference.gains is None else _through(reference.gains, G, inverse)
        position, velocity = G @ reference.q + self.offset, G @ reference.qd
        return MotorReference(reference.seq, reference.time, position, velocity, reference.active, torque, gains)

    def to_arm(self, reference: MotorReference) -> JointReference:
        """The reference on the arm side, inverse of `to_motor`.

        Raises:
            ConfigurationError: It has gains, and the gears are coupled so that no gain per joint equals them.
        """
        G, inverse = self.matrix, self._inverse
        torque = None if reference.torque is None else G.T @ reference.torque
        gains = None if reference.gains is None else _through(reference.gains, inverse, G)
        q, qd = inverse @ (reference.position - self.offset), inverse @ reference.velocity
        return JointReference(reference.seq, reference.time, q, qd, reference.active, torque, gains)


def _through(gains: ServoGains, there: Array, back: Array) -> ServoGains:
    """Gains on the other side of angles x' = T x: Kp' = T Kp T⁻¹, Kv' = T⁻ᵀ Kv T⁻¹, Ki' likewise."""
    kp = _diagonal("kp", there @ np.diag(gains.kp) @ back)
    kv, ki = (_diagonal(name, back.T @ np.diag(getattr(gains, name)) @ back) for name in ("kv", "ki"))
    return ServoGains(kp, kv, ki)


def _diagonal(name: str, matrix: Array) -> Array:
    """The gains on the diagonal, if there are no others: one gain an axis cannot stand for a full matrix."""
    diagonal = np.diag(matrix).copy()
    rest = np.abs(matrix - np.diag(diagonal)).max(initial=0.0)
    if not rest <= 1e-9 * np.abs(diagonal).max(initial=0.0):
        raise ConfigurationError("GearRatios", f"gains.{name}", diagonal, "no gains: coupled gears mix them")
    return diagonal


def _numbers(key: str, values: ArrayLike, shape: tuple[int, ...] | None) -> Array:
    expected = "finite numbers, one a joint" if shape is None else f"finite numbers of shape {shape}"
    array = numbers("GearRatios", key, values, expected)
    fits = array.ndim == 1 and len(array) > 0 if shape is None else array.shape == shape
    if not (fits and np.isfinite(array).all()):
        raise ConfigurationError("GearRatios", key, values, expected)
    return array
