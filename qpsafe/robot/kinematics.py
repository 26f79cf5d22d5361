"""Forward kinematics and Jacobians of a tree of one-degree-of-freedom joints, compiled, in one pass.

The tree is taken from the pinocchio model once. Body 0 is the world; body i > 0 is moved by joint i - 1 and hangs on
body `parents[i - 1]`, an earlier one. A joint at q moves its body along its screw axis (v, ω) in the joint's own frame:
T_i = T_parent P_i exp((v, ω) q), with ω a unit vector and v = 0 (revolute) or ω = 0 and v a unit vector (prismatic).
"""

from __future__ import annotations

from math import cos, sin
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, entry, inline
from qpsafe.compiled.memory import view

Index = NDArray[np.int64]


class Tree(NamedTuple):
    """What forward kinematics needs of a robot, in flat arrays; n joints, k ends of the wire.

    Attributes:
        parents: Body that each body hangs on, (n,).
        placements: P_i, of each joint in its parent body at q = 0, (n, 4, 4) [m].
        axes: Screw axes (v, ω) in the joints' frames, (n, 6).
        supports: 1 where joint j moves body i, else 0, (n + 1, n).
        end_bodies: Body that carries each end of the wire, (k,).
        end_places: Where on that body, (k, 3) [m].
    """

    parents: Index
    placements: Array
    axes: Array
    supports: Array
    end_bodies: Index
    end_places: Array

    @property
    def memory(self) -> int:
        """Floats in the result of `forward`."""
        n, k = len(self.parents), len(self.end_bodies)
        return 16 * (n + 1) + 6 * n + 3 * k + 3 * k * n


def tree_of(model: Any, ends: tuple[int, ...]) -> Tree:
    """The tree of a pinocchio model, with the frames (pinocchio's indices) that end segments of the wire."""
    import pinocchio as pin

    n = model.nq
    data, parents = pin.Data(model), np.array(list(model.parents)[1:], dtype=np.int64)
    pin.computeJointJacobians(model, data, pin.neutral(model))
    supports = np.zeros((n + 1, n))
    for i, parent in enumerate(parents):
        supports[i + 1] = supports[parent]
        supports[i + 1, i] = 1.0
    frames = [model.frames[index] for index in ends]
    return Tree(
        parents,
        np.array([placement.homogeneous for placement in list(model.jointPlacements)[1:]]),
        np.array([np.asarray(joint.S).reshape(6) for joint in list(data.joints)[1:]]),
        supports,
        np.array([frame.parentJoint for frame in frames], dtype=np.int64),
        np.array([frame.placement.translation for frame in frames]).reshape(-1, 3),
    )


@inline
def cut(memory: Array, n: int, k: int) -> tuple[Array, Array, Array, Array]:
    """Parts of the result of `forward`: poses of the bodies in the world (n + 1, 4, 4), joints' twists (6, n), ends of
    the wire (k, 3) and their linear Jacobians (k, 3, n)."""
    a, b, c = 16 * (n + 1), 16 * (n + 1) + 6 * n, 16 * (n + 1) + 6 * n + 3 * k
    return (
        view(memory, 0, (n + 1, 4, 4)),
        view(memory, a, (6, n)),
        view(memory, b, (k, 3)),
        view(memory, c, (k, 3, n)),
    )


@inline
def place(T: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The point (x, y, z) of the body at T, in the world."""
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@inline
def _joint(P: Array, axis: Array, q: float, parent: Array, T: Array, twists: Array, j: int) -> None:
    """Pose T of a joint's body, and the joint's twist at the world's origin in column j."""
    vx, vy, vz, x, y, z = axis[0], axis[1], axis[2], axis[3], axis[4], axis[5]
    s, c = sin(q), cos(q)
    u = 1.0 - c
    # exp(ω q) = I + sin q [ω] + (1 - cos q) [ω]², the identity for ω = 0
    R = (
        (1.0 - u * (y * y + z * z), u * x * y - s * z, u * x * z + s * y),
        (u * x * y + s * z, 1.0 - u * (x * x + z * z), u * y * z - s * x),
        (u * x * z - s * y, u * y * z + s * x, 1.0 - u * (x * x + y * y)),
    )
    for a in range(3):
        # row a of the joint's frame before it moves
        p0 = parent[a, 0] * P[0, 0] + parent[a, 1] * P[1, 0] + parent[a, 2] * P[2, 0]
        p1 = parent[a, 0] * P[0, 1] + parent[a, 1] * P[1, 1] + parent[a, 2] * P[2, 1]
        p2 = parent[a, 0] * P[0, 2] + parent[a, 1] * P[1, 2] + parent[a, 2] * P[2, 2]
        p3 = parent[a, 0] * P[0, 3] + parent[a, 1] * P[1, 3] + parent[a, 2] * P[2, 3] + parent[a, 3]
        T[a, 0] = p0 * R[0][0] + p1 * R[1][0] + p2 * R[2][0]
        T[a, 1] = p0 * R[0][1] + p1 * R[1][1] + p2 * R[2][1]
        T[a, 2] = p0 * R[0][2] + p1 * R[1][2] + p2 * R[2][2]
        T[a, 3] = p3 + q * (p0 * vx + p1 * vy + p2 * vz)
        twists[a, j] = p0 * vx + p1 * vy + p2 * vz
        twists[3 + a, j] = p0 * x + p1 * y + p2 * z
    T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[3, 3] = 1.0
    # the body's point at the world's origin moves with v + r × ω
    wx, wy, wz = twists[3, j], twists[4, j], twists[5, j]
    twists[0, j] += T[1, 3] * wz - T[2, 3] * wy
    twists[1, j] += T[2, 3] * wx - T[0, 3] * wz
    twists[2, j] += T[0, 3] * wy - T[1, 3] * wx


@inline
def point_jacobian(twists: Array, support: Array, x: float, y: float, z: float, J: Array) -> None:
    """Linear Jacobian J (3, n) of the point (x, y, z) of a body: joint j moves it by v + ω × p, if at all."""
    for j in range(twists.shape[1]):
        on = support[j]
        J[0, j] = on * (twists[0, j] + twists[4, j] * z - twists[5, j] * y)
        J[1, j] = on * (twists[1, j] + twists[5, j] * x - twists[3, j] * z)
        J[2, j] = on * (twists[2, j] + twists[3, j] * y - twists[4, j] * x)


def _read(ndim: int) -> Any:
    return types.Array(types.float64, ndim, "C", readonly=True)


_ints = types.Array(types.int64, 1, "C", readonly=True)
tree_types = (_ints, _read(3), _read(2), _read(2), _ints, _read(2))


@entry(types.void(_read(1), *tree_types, types.float64[::1]))
def forward(
    q: Array,
    parents: Index,
    placements: Array,
    axes: Array,
    supports: Array,
    end_bodies: Index,
    end_places: Array,
    memory: Array,
) -> None:
    """Everything of a configuration q (n,) that does not depend on a velocity, into `memory`; see `cut`."""
    n, k = parents.shape[0], end_bodies.shape[0]
    bodies, twists, ends, jacobians = cut(memory, n, k)
    for a in range(4):
        for b in range(4):
            bodies[0, a, b] = 1.0 if a == b else 0.0
    for i in range(n):
        _joint(placements[i], axes[i], q[i], bodies[parents[i]], bodies[i + 1], twists, i)
    for i in range(k):
        x, y, z = place(bodies[end_bodies[i]], end_places[i, 0], end_places[i, 1], end_places[i, 2])
        ends[i, 0], ends[i, 1], ends[i, 2] = x, y, z
        point_jacobian(twists, supports[end_bodies[i]], x, y, z, jacobians[i])


@inline
def frame_pose(body: Array, placement: Array, pose: Array) -> None:
    """Pose (4, 4) in the world of a frame with a placement (4, 4) on a body (4, 4)."""
    for a in range(3):
        for b in range(4):
            value = body[a, 0] * placement[0, b] + body[a, 1] * placement[1, b] + body[a, 2] * placement[2, b]
            pose[a, b] = value + (body[a, 3] if b == 3 else 0.0)
    pose[3, 0] = pose[3, 1] = pose[3, 2] = 0.0
    pose[3, 3] = 1.0


@entry(types.void(_read(1), _read(2), types.int64, types.int64, _read(2), types.float64[:, ::1]))
def pose_of(memory: Array, supports: Array, k: int, body: int, placement: Array, pose: Array) -> None:
    """Pose (4, 4) of a frame, from the result of `forward`."""
    frame_pose(cut(memory, supports.shape[1], k)[0][body], placement, pose)


@entry(types.void(_read(1), _read(2), types.int64, types.int64, _read(2), types.float64[:, ::1]))
def jacobian_of(memory: Array, supports: Array, k: int, body: int, placement: Array, J: Array) -> None:
    """Geometric Jacobian (6, n) of a frame, world axes, linear rows first, from the result of `forward`."""
    n = supports.shape[1]
    bodies, twists, _, _ = cut(memory, n, k)
    x, y, z = place(bodies[body], placement[0, 3], placement[1, 3], placement[2, 3])
    point_jacobian(twists, supports[body], x, y, z, J)
    for a in range(3, 6):
        for j in range(n):
            J[a, j] = supports[body, j] * twists[a, j]


_places = types.Array(types.int64, 1, "A", readonly=True)


@entry(
    types.void(
        _read(1),
        types.int64,
        types.Array(types.float64, 1, "A", readonly=True),
        _places,
        _places,
        types.float64[:, :, ::1],
    )
)
def wire_of(memory: Array, k: int, qd: Array, starts: Index, stops: Index, parts: Array) -> None:
    """Fill parts (4, links, 3): starts, ends, start velocities, end velocities of the wire; v = J q̇."""
    _, _, ends, jacobians = cut(memory, qd.shape[0], k)
    for side in range(2):
        places = starts if side == 0 else stops
        for i in range(places.shape[0]):
            for c in range(3):
                velocity = 0.0
                for j in range(qd.shape[0]):
                    velocity += jacobians[places[i], c, j] * qd[j]
                parts[side, i, c] = ends[places[i], c]
                parts[2 + side, i, c] = velocity
