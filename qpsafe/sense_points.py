"""The first half of a tick in one compiled call where the detected points are given: danger, torque and evasion."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import types

from qpsafe.danger import compiled, push
from qpsafe.danger.compiled import Array, entry, linked, readable
from qpsafe.danger.evasion import Evasion, filter_by
from qpsafe.danger.field import DangerField
from qpsafe.danger.push import push_by
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, forward, tree_types, wire_of
from qpsafe.sense import Sensed, check_danger
from qpsafe.sensing import detection
from qpsafe.sensing.detection import find_nearest, plausible

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

_FLOAT = np.dtype(np.float64)

# each is compiled once, for Python and for this call
_forward, _wire_of, _filter_by = linked(forward), linked(wire_of), linked(filter_by)
_push_by, _find_nearest = linked(push_by, *push.USES), linked(find_nearest, compiled)

_any, _two = readable(1), types.Array(types.float64, 2, "C", readonly=True)
_places = types.Array(types.int64, 1, "A", readonly=True)
_out, _outs, _out_ints = types.float64[::1], types.float64[:, ::1], types.int64[::1]


@entry(
    types.Tuple((types.boolean, types.float64))(
        _any, _any, readable(2), _two, *tree_types, _places, _places,
        types.float64, types.float64, types.float64, types.float64, readable(2), readable(2), _any,
        types.int64, _out, _outs, _out_ints, _outs, _out,
    ),
    kinematics, push, detection, *push.USES,
)  # fmt: skip
def push_quickly(
    q: Array, qd: Array, given: Array, plausible: Array,
    parents: Index, placements: Array, axes: Array, supports: Array, end_bodies: Index, end_places: Array,
    starts: Index, stops: Index,
    static: float, kinetic: float, gamma: float, floor: float, A: Array, B: Array, before: Array,
    size: int, work: Array, points: Array, links: Index, vectors: Array, qd0: Array,
) -> tuple[bool, float]:  # fmt: skip
    """Fill points, links, vectors and qd0; arguments as for the calls below, `size` of the kinematics.

    Returns:
        Whether measurement and points can be used; CDF_n, NaN if anything is not finite.
    """
    n, k, m, p = q.shape[0], end_bodies.shape[0], starts.shape[0], given.shape[0]
    for i in range(n):
        sane = plausible[0, i] <= q[i] <= plausible[1, i] and plausible[2, i] <= qd[i] <= plausible[3, i]
        if not sane:  # NaN too
            return False, nan
    a = size + 12 * m
    memory, wire, torque, values = work[:size], work[size:a].reshape(4, m, 3), work[a : a + n], work[a + n :]
    # q, q̇ -> kinematics, wire (4)
    for i in range(n):  # contiguous
        torque[i] = q[i]
    _forward(torque, parents, placements, axes, supports, end_bodies, end_places, memory)
    _wire_of(memory, k, qd, starts, stops, wire)
    for i in range(p):
        for c in range(3):
            points[i, c] = given[i, c]
    if not _find_nearest(points, wire[0], wire[1], links):
        return False, nan
    # points at rest -> danger (1)-(6) -> virtual torque (8), (14), (15)
    cdf_n = _push_by(
        points, points[:0], links, wire[0], wire[1], wire[2], wire[3], (static, kinetic, gamma), floor, memory, k,
        starts, stops, values, vectors, torque,
    )  # fmt: skip
    # -> evasive velocity (16)
    _filter_by(A, B, before, torque, qd0)
    return True, cdf_n


class QuickPoints:
    """`qpsafe.sense.sense` in one compiled call, for points (p, 3).

    Args:
        robot: The robot.
        field: The danger field.
        evasion: The admittance.
    """

    def __init__(self, robot: Robot, field: DangerField, evasion: Evasion) -> None:
        self._evasion, self._shape = evasion, (robot.nq,)
        self._body = (np.array(plausible(robot)), *robot.tree, *robot.wire_indices)
        self._weights = field.static, field.kinetic, field.gamma, field.floor
        self._memory, self._size = robot.memory, robot.memory + 12 * len(robot.wire_frames) + robot.nq

    @staticmethod
    def fits(field: Any, evasion: Any) -> bool:
        """Whether everything is of the kind that the compiled call knows."""
        return type(field) is DangerField and type(evasion) is Evasion

    def __call__(self, q: Any, qd: Any, points: Any) -> Sensed | None:
        """One tick; None where something is unusual, which `sense` then names: nothing has been touched.

        Raises:
            BadInput: Danger that is not finite.
        """
        if not (type(q) is type(qd) is type(points) is np.ndarray and q.dtype is qd.dtype is points.dtype is _FLOAT):
            return None
        if not (q.shape == qd.shape == self._shape and points.ndim == 2 and points.shape[1] == 3):
            return None
        evasion, p = self._evasion, len(points)
        own, links, vectors, qd0 = np.empty((p, 3)), np.empty(p, np.int64), np.empty((p, 3)), np.empty(len(q))
        good, cdf_n = push_quickly(
            q, qd, points, *self._body, *self._weights, *evasion.matrices, evasion.velocity,
            self._memory, np.empty(self._size + p), own, links, vectors, qd0,
        )  # fmt: skip
        if not good:
            return None
        check_danger(cdf_n)
        evasion.velocity = qd0
        return Sensed(own, links, vectors, cdf_n, qd0.copy(), (), False)
