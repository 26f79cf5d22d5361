"""Rotation matrices, rotation vectors and the paper's Euler angles."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray


def log3(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation vector (3,) of a rotation matrix (3, 3), its norm the angle in [0, pi]."""
    return pin.log3(np.ascontiguousarray(R))


def exp3(w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) of a rotation vector (3,)."""
    return pin.exp3(w)


def is_rotation(R: NDArray[np.float64], tolerance: float = 1e-6) -> bool:
    """Whether R (3, 3) is orthogonal with determinant +1 within `tolerance`."""
    return bool(np.abs(R @ R.T - np.eye(3)).max() <= tolerance and np.linalg.det(R) > 0.0)


def euler_zyx(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Euler angles (φ, θ, ψ) about z, y', x'' of rotation matrices (..., 3, 3): R = Rz(φ) Ry(θ) Rx(ψ), (..., 3) [rad].

    The paper does not name its convention; this is the one of ABB's controllers. It is singular at θ = ±pi/2, where φ
    and ψ are not unique. Offered for comparison and plots.
    """
    phi = np.arctan2(R[..., 1, 0], R[..., 0, 0])
    theta = np.arctan2(-R[..., 2, 0], np.hypot(R[..., 0, 0], R[..., 1, 0]))
    psi = np.arctan2(R[..., 2, 1], R[..., 2, 2])
    return np.stack((phi, theta, psi), axis=-1)


def euler_difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """a - b of angles, wrapped to (-pi, pi], same shape [rad]."""
    return np.pi - np.mod(np.pi - (a - b), 2.0 * np.pi)


def euler_zyx_rates(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """E⁻¹ (3, 3) at the orientation R (3, 3): angular velocity in world axes to rates of `euler_zyx`'s φ, θ, ψ.

    ω = φ̇ z + θ̇ y' + ψ̇ x''. With y' and x'' from R, cos θ = 0 makes the matrix infinite: it is limited to 1e6 there.
    """
    phi, theta, _ = euler_zyx(R)
    s, c = np.sin(phi), np.cos(phi)
    cos = np.copysign(max(abs(np.cos(theta)), 1e-6), np.cos(theta))
    tan = np.sin(theta) / cos
    return np.array([[c * tan, s * tan, 1.0], [-s, c, 0.0], [c / cos, s / cos, 0.0]])
