"""From detected points to the virtual torque that pushes the robot away, compiled: eqs. (1) to (8), (14), (15)."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.danger import evasion, field, kernel, speed, vector
from qpsafe.danger.compiled import Array, entry, linked, readable
from qpsafe.danger.evasion import act, link_vectors, virtual_torque
from qpsafe.danger.field import AT_REST, DangerField, danger_vectors
from qpsafe.danger.kernel import danger_field
from qpsafe.danger.vector import vector_of
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import cut

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState
    from qpsafe.robot.wire import Wire

#: Danger and vectors at the points (p,), (p, 3), virtual torque (n,), CDF_n; NaN in CDF_n if anything is not finite.
Push = tuple[Array, Array, Array, float]


def push(
    danger: Any, state: RobotState, wire: Wire, points: Array, links: NDArray[np.int64], velocities: Array | None
) -> Push:
    """Danger of the detected points and the virtual torque they cause.

    Args:
        danger: The danger field.
        state: Robot at the measured joint position.
        wire: Its wire with the measured velocities.
        points: Detected points (p, 3) [m].
        links: Wire link of each point (p,).
        velocities: Of the points (p, 3) [m/s], or None where they stand still.
    """
    if type(danger) is not DangerField:
        return _by_parts(danger, state, wire, points, links, velocities)
    robot = state.robot
    values, vectors, torque = np.empty(len(points)), np.empty((len(points), 3)), np.empty(robot.nq)
    weights = (danger.static, danger.kinetic, danger.gamma)
    moving = AT_REST if velocities is None else velocities
    cdf_n = push_by(
        points, moving, links, *wire, weights, danger.floor, state.memory, robot.ends, *robot.wire_indices,
        values, vectors, torque,
    )  # fmt: skip
    return values, vectors, torque, cdf_n


def _by_parts(
    danger: Any, state: RobotState, wire: Wire, points: Array, links: NDArray[np.int64], velocities: Array | None
) -> Push:
    """The same for fields of another making, equation by equation."""
    values, gradient = danger.evaluate(points, wire, velocities)  # (1)-(5)
    vectors = danger_vectors(values, gradient)  # (6)
    torque = virtual_torque(state, link_vectors(vectors, links, len(wire.starts)))  # (8), (14), (15)
    good = np.isfinite(values).all() and np.isfinite(torque).all()
    return values, vectors, torque, float(values.max(initial=0.0)) if good else np.nan


_danger_field = linked(danger_field)
_rows, _ints = readable(2), types.Array(types.int64, 1, "A", readonly=True)
_weights, _out, _outs = types.UniTuple(types.float64, 3), types.float64[::1], types.float64[:, ::1]


USES = (evasion, field, kernel, speed, vector, kinematics)


@entry(
    types.float64(
        _rows, _rows, _ints, _rows, _rows, _rows, _rows, _weights, types.float64,
        types.Array(types.float64, 1, "C", readonly=True), types.int64, _ints, _ints, _out, _outs, _out,
    ),
    *USES,
)  # fmt: skip
def push_by(
    points: Array,
    velocities: Array,
    links: Array,
    r0: Array,
    r1: Array,
    v0: Array,
    v1: Array,
    weights: Any,
    floor: float,
    memory: Array,
    k: int,
    starts: Array,
    stops: Array,
    values: Array,
    vectors: Array,
    torque: Array,
) -> float:
    """Fill values, vectors, torque; returns CDF_n."""  # fmt: skip
    _danger_field(points, velocities, r0, r1, v0, v1, weights, floor, values, vectors)  # (1)-(5), gradients
    jacobians = cut(memory, torque.shape[0], k)[3]
    torque[:] = 0.0
    cdf_n, good = 0.0, True
    for i in range(points.shape[0]):
        v = vector_of(values[i], vectors, i)  # (6)
        vectors[i, 0], vectors[i, 1], vectors[i, 2] = v
        # (8), (14), (15): each vector acts on its link, at both ends
        act(v, jacobians[starts[links[i]]], jacobians[stops[links[i]]], torque)
        cdf_n = max(cdf_n, values[i])
        good = good and isfinite(values[i])
    for j in range(torque.shape[0]):
        good = good and isfinite(torque[j])
    return cdf_n if good else np.nan
