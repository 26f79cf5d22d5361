"""Virtual torque, eqs. (8), (14), (15): danger vectors as forces on the links of the wire."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, Vector, entry, inline, readable, row

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
