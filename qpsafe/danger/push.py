"""From detected points to the virtual torque that pushes the robot away, compiled: eqs. (1) to (8), (14), (15)."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, entry, inline, linked, readable
from qpsafe.danger import evasion, field, link_field, speed, vector
from qpsafe.danger.evasion import act
from qpsafe.danger.link_field import danger_field
from qpsafe.danger.vector import vector_of
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import cut

_danger_field = linked(danger_field)
_rows, _ints = readable(2), types.Array(types.int64, 1, "A", readonly=True)
_weights, _out, _outs = types.UniTuple(types.float64, 3), types.float64[::1], types.float64[:, ::1]


USES = (evasion, field, link_field, speed, vector, kinematics)


@inline
def _push(
    values: Array, links: Array, memory: Array, k: int, starts: Array, stops: Array, vectors: Array, torque: Array
) -> float:
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


_memory = types.Array(types.float64, 1, "C", readonly=True)


@entry(
    types.float64(
        _rows, _rows, _ints, _rows, _rows, _rows, _rows, _weights, types.float64, _memory, types.int64, _ints, _ints,
        _out, _outs, _out,
    ),
    *USES,
)  # fmt: skip
def push_by(
    points: Array, velocities: Array, links: Array, r0: Array, r1: Array, v0: Array, v1: Array, weights: Any,
    floor: float, memory: Array, k: int, starts: Array, stops: Array, values: Array, vectors: Array, torque: Array,
) -> float:  # fmt: skip
    """Danger of detected points and the virtual torque it causes: fill values, vectors, torque; returns CDF_n.

    Args:
        points, velocities, links: Detected points (p, 3) [m], their velocities (p, 3) [m/s] or (0, 3) where they stand
            still, their wire links (p,).
        r0, r1, v0, v1: The wire, (links, 3) each.
        weights, floor: Of the field.
        memory, k, starts, stops: Kinematics, see `kinematics.forward`, and the wire in it.
        values, vectors, torque: CDF (p,), vectors (6) (p, 3), σ (n,).

    Returns:
        CDF_n; NaN if anything is not finite.
    """  # fmt: skip
    _danger_field(points, velocities, r0, r1, v0, v1, weights, floor, values, vectors)  # (1)-(5), gradients
    return _push(values, links, memory, k, starts, stops, vectors, torque)


@entry(types.float64(readable(1), _ints, _memory, types.int64, _ints, _ints, _outs, _out), *USES)
def push_vectors(
    values: Array, links: Array, memory: Array, k: int, starts: Array, stops: Array, vectors: Array, torque: Array
) -> float:
    """The same from values and gradients of a field of another making; `vectors` holds the gradients (p, 3) before."""
    return _push(values, links, memory, k, starts, stops, vectors, torque)
