"""Evasive motion, eqs. (8), (14)-(16): danger vectors as virtual forces on the links, through an admittance filter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled.compiled import Array, Vector, entry, inline, readable, row
from qpsafe.errors import ConfigurationError
from qpsafe.text.words import call

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState


def link_vectors(vectors: NDArray[np.float64], links: NDArray[np.int64], n_links: int) -> NDArray[np.float64]:
    """Sum the danger vectors of each link's points, eq. (8).

    Args:
        vectors: Danger vectors (6), (p, 3), world frame.
        links: Wire link that saw each point, (p,), in 0..n_links-1.
        n_links: Number of wire links.

    Returns:
        One vector per link, (n_links, 3); zero where the link saw nothing.
    """
    total = np.zeros((n_links, 3))
    _sum_by_link(vectors, links, total)
    return total


def virtual_torque(state: RobotState, forces: NDArray[np.float64]) -> NDArray[np.float64]:
    """Virtual joint torque of the link vectors, each applied at both end frames of its link, eqs. (14), (15).

    Only the linear rows of the Jacobians act, since the wrench has no moment. An end frame on the static base has a
    zero Jacobian and adds nothing.

    Args:
        state: Robot at the measured joint position.
        forces: One vector per wire link, (links, 3), world frame.

    Returns:
        σ, (n,).
    """
    starts, stops = state.robot.wire_indices
    torque = np.zeros(len(state.q))
    _torque(state.wire_jacobians(), starts, stops, forces, torque)
    return torque


_links = types.Array(types.int64, 1, "A", readonly=True)


@entry(types.void(readable(2), _links, types.float64[:, ::1]))
def _sum_by_link(vectors, links, total):  # type: ignore[no-untyped-def]
    for k in range(len(links)):  # (8)
        for c in range(3):
            total[links[k], c] += vectors[k, c]


@inline
def act(force: Vector, J0: Array, J1: Array, torque: Array) -> None:
    """Add the torque of a force at both ends of a link; J0, J1 (3, n) are their linear Jacobians."""
    for c in range(3):
        if force[c] != 0.0:
            for j in range(torque.shape[0]):
                # (14) W_i = [CDF_link_i; 0] at frames i-1 and i, (15) σ = Σ_i (J_(i-1) + J_i)ᵀ CDF_link_i
                torque[j] += (J0[c, j] + J1[c, j]) * force[c]


@entry(types.void(types.Array(types.float64, 3, "C", readonly=True), _links, _links, readable(2), types.float64[::1]))
def _torque(J, starts, stops, forces, torque):  # type: ignore[no-untyped-def]
    for i in range(len(starts)):
        act(row(forces, i), J[starts[i]], J[stops[i]], torque)


@entry(types.void(readable(2), readable(2), readable(1), readable(1), types.float64[::1]))
def filter_by(A, B, before, sigma, after):  # type: ignore[no-untyped-def]
    """after = A before + B σ."""
    for i in range(len(before)):
        after[i] = 0.0
        for j in range(len(before)):
            after[i] += A[i, j] * before[j] + B[i, j] * sigma[j]


#: Virtual mass [N m s²/rad] and damping [N m s/rad] of every joint where nothing else is said.
DEFAULT_MASS, DEFAULT_DAMPING = 4.0, 20.0


class Evasion:
    """Mass-damper admittance q̇0 = (M s + D)^-1 σ, eq. (16), sampled exactly for a held input.

    Args:
        mass: M, scalar, (n,) diagonal or (n, n) symmetric positive definite.
        damping: D, likewise. D sets the steady speed D^-1 σ, D/M how fast it is reached.
        n: Number of joints.
        dt: Sample time [s].

    Raises:
        ConfigurationError: A matrix of wrong shape or not symmetric positive definite, or dt <= 0.
    """

    def __init__(self, mass: ArrayLike, damping: ArrayLike, n: int, dt: float = 0.004) -> None:
        from scipy.linalg import expm

        if not (np.isfinite(dt) and dt > 0.0):
            raise ConfigurationError("Evasion", "dt", dt, "a finite time > 0 [s]")
        self._dt = float(dt)
        self._mass = _positive_definite(mass, n, "mass")
        self._damping = _positive_definite(damping, n, "damping")
        # zero-order hold: q̇0 <- A q̇0 + (I - A) D^-1 σ,  A = expm(-M^-1 D dt)
        self._A = expm(-np.linalg.solve(self._mass, self._damping) * dt)
        self._B = np.linalg.solve(self._damping.T, (np.eye(n) - self._A).T).T
        for array in (self._mass, self._damping, self._A, self._B):
            array.flags.writeable = False
        self._velocity = np.zeros(n)

    def __repr__(self) -> str:
        return call(self, mass=np.diag(self._mass), damping=np.diag(self._damping), dt=self._dt)

    @classmethod
    def default(cls, n: int, dt: float) -> Evasion:
        """That of a controller which is given none, tuned on the first experiment."""
        return cls(DEFAULT_MASS, DEFAULT_DAMPING, n, dt)

    @property
    def mass(self) -> NDArray[np.float64]:
        """M (n, n), read-only."""
        return self._mass

    @property
    def damping(self) -> NDArray[np.float64]:
        """D (n, n), read-only."""
        return self._damping

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return self._dt

    @property
    def velocity(self) -> NDArray[np.float64]:
        """q̇0 (n,) [rad/s] of the last step, which the next one goes on from; another one is copied."""
        return self._velocity

    @velocity.setter
    def velocity(self, velocity: ArrayLike) -> None:
        self._velocity = self._vector("velocity", velocity)

    def step(self, sigma: NDArray[np.float64]) -> NDArray[np.float64]:
        """Advance one sample under the virtual torque σ (n,) and return the evasive velocity q̇0 (n,) [rad/s].

        Raises:
            ConfigurationError: σ is not n finite numbers.
        """
        velocity = np.empty(len(self._velocity))
        filter_by(self._A, self._B, self._velocity, self._vector("sigma", sigma), velocity)
        self._velocity = velocity
        return velocity

    def remember(self, velocity: NDArray[np.float64]) -> None:
        """Take what compiled code has computed for a step (n,) [rad/s], finite."""
        self._velocity = velocity.copy()

    def _vector(self, key: str, value: ArrayLike) -> NDArray[np.float64]:
        """A copy as n finite numbers; compiled code does not look at sizes."""
        shape = self._velocity.shape
        try:
            vector = np.array(value, dtype=float)
        except (TypeError, ValueError):
            vector = np.full(shape, np.nan)
        if vector.shape != shape or not np.isfinite(vector).all():
            raise ConfigurationError("Evasion", key, value, f"{shape[0]} finite numbers")
        return vector

    @property
    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A, B (n, n) of a step, q̇0 <- A q̇0 + B σ."""
        return self._A, self._B

    def reset(self) -> None:
        """Forget the past: q̇0 = 0."""
        self._velocity = np.zeros_like(self._velocity)


def _positive_definite(value: ArrayLike, n: int, key: str) -> NDArray[np.float64]:
    """Scalar, diagonal or full matrix as a checked (n, n) symmetric positive definite array."""
    expected = f"a positive scalar, ({n},) positive diagonal or ({n}, {n}) symmetric positive definite matrix"
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ConfigurationError("Evasion", key, value, expected) from None
    if array.ndim < 2 and array.shape in ((), (1,), (n,)):
        array = np.diag(np.broadcast_to(array, n).astype(float))
    if array.shape != (n, n) or not np.isfinite(array).all() or not np.allclose(array, array.T):
        raise ConfigurationError("Evasion", key, value, expected)
    if np.linalg.eigvalsh(array)[0] <= 0.0:
        raise ConfigurationError("Evasion", key, value, expected)
    return array
