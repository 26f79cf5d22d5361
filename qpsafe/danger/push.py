"""From danger to the virtual torque that pushes the robot away, compiled: eqs. (6), (8), (14), (15)."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, entry, readable
from qpsafe.danger import torque as torque_module
from qpsafe.danger import vector
from qpsafe.danger.torque import act
from qpsafe.danger.vector import vector_of
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut

USES = (torque_module, vector, kinematics)
_ints = types.Array(types.int64, 1, "A", readonly=True)
_memory = types.Array(types.float64, 1, "C", readonly=True)


@entry(
    types.float64(
        readable(1), _ints, _memory, types.int64, _ints, _ints, types.float64[:, ::1], types.float64[::1]
    ),
    *USES,
)  # fmt: skip
def push_vectors(
    values: Array, links: Index, memory: Array, k: int, starts: Index, stops: Index, vectors: Array, torque: Array
) -> float:
    """Danger vectors of detected points and the virtual torque they cause: fill vectors and torque; returns CDF_n.

    Args:
        values, links: CDF at the points (p,), and their wire links (p,).
        memory, k, starts, stops: Kinematics, see `kinematics.forward`, and the wire in it.
        vectors: Gradients of CDF at first, vectors (6) afterwards (p, 3).
        torque: σ (n,).

    Returns:
        CDF_n; NaN if anything is not finite.
    """
    jacobians = cut(memory, torque.shape[0], k)[3]
    torque[:] = 0.0
    cdf_n, good = 0.0, True
    for i in range(values.shape[0]):
        v = vector_of(values[i], vectors, i)  # (6)
        vectors[i, 0], vectors[i, 1], vectors[i, 2] = v
        # (8), (14), (15): each vector acts on its link, at both ends
        act(v, jacobians[starts[links[i]]], jacobians[stops[links[i]]], torque)
        cdf_n = max(cdf_n, values[i])
        good = good and isfinite(values[i])
    for j in range(torque.shape[0]):
        good = good and isfinite(torque[j])
    return cdf_n if good else np.nan
