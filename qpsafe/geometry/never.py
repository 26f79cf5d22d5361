"""Pairs of a robot's shapes that cannot come nearer than a margin in any configuration: nobody need look at them.

Proved by dividing the range of the few joints between two bodies. In a box of configurations with the half widths h
around q the distance is no less than d(q) - Σ_j l_j h_j, l_j being how far any point of the moving shape can be from
the axis of joint j. Where that is not enough the box is halved.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, entry, linked
from qpsafe.compiled.memory import view
from qpsafe.geometry import pairs as pairs_module
from qpsafe.geometry.layout import BALL, BODY, VERTEX, VERTICES
from qpsafe.geometry.pairs import measured, pose_of
from qpsafe.geometry.separation import WORK, hull_types
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut, forward, tree_types
from qpsafe.sensing.detection import SLIDING_EXCESS

if TYPE_CHECKING:
    from qpsafe.geometry.solids import Solids
    from qpsafe.robot.robot import Robot

MOST_JOINTS = 2  # between two bodies, of which a range is divided
BOXES = 10000  # looked at for one pair, before it counts as one that may meet
BEYOND = 0.05  # so much beyond their limits joints that turn may be [rad]
_DEPTH = 64
_forward = linked(forward)
_proved: dict[int, frozenset[tuple[int, int]]] = {}


def never_nearer(solids: Solids, robot: Robot, margin: float) -> frozenset[tuple[int, int]]:
    """Those of `solids.own` that are always farther apart than a margin, of what could be proved.

    Args:
        solids: The solids.
        robot: The robot among them.
        margin: [m].
    """
    parts = (robot.tree.placements, robot.tree.axes, robot.tree.supports, robot.lower, robot.upper, robot.home,
             solids.index, solids.shapes, solids.vertices, solids.own, np.array(margin))  # fmt: skip
    key = 0
    for part in parts:
        key = crc32(np.ascontiguousarray(part).tobytes(), key)
    if key not in _proved:
        if len(_proved) >= 64:
            _proved.clear()
        _proved[key] = frozenset(
            pair for pair in map(tuple, solids.own.tolist()) if _apart(solids, robot, pair, margin)
        )
    return _proved[key]


def _apart(solids: Solids, robot: Robot, pair: tuple[int, int], margin: float) -> bool:
    tree = robot.tree
    a, b = solids.index[list(pair), BODY].tolist()
    joints = np.flatnonzero(tree.supports[a] != tree.supports[b])
    if len(joints) > MOST_JOINTS:
        return False
    slides = np.asarray(np.abs(tree.axes[:, :3]).any(axis=1))
    beyond = np.where(slides, SLIDING_EXCESS, BEYOND)
    turns = ~slides & ~(np.isfinite(robot.lower) & np.isfinite(robot.upper))
    low, high = (
        np.where(turns, -np.pi, robot.lower - beyond)[joints],
        np.where(turns, np.pi, robot.upper + beyond)[joints],
    )
    if not (np.isfinite(low) & np.isfinite(high)).all():
        return False
    levers = np.array([_lever(solids, robot, pair, j, slides) for j in joints.tolist()])
    work = np.empty(43 + WORK + 2 * MOST_JOINTS * _DEPTH + robot.nq)
    return bool(
        _never(robot.home, *tree, joints, levers, low, high, *pair, *solids.solid, margin, np.empty(robot.memory), work)
    )


def _lever(solids: Solids, robot: Robot, pair: tuple[int, int], j: int, slides: NDArray[np.bool_]) -> float:
    """How far a point of the shape that joint j moves can be from its axis; 1 where it slides."""
    if slides[j]:
        return 1.0
    tree = robot.tree
    (shape,) = [i for i in pair if tree.supports[solids.index[i, BODY], j] != 0.0]
    ball, body = solids.shapes[shape, BALL:], int(solids.index[shape, BODY])
    if body == j + 1:  # from the axis itself
        first, count = solids.index[shape, [VERTEX, VERTICES]]
        corners, axis = solids.vertices[first : first + count], tree.axes[j, 3:]
        return float(np.linalg.norm(corners - np.outer(corners @ axis, axis), axis=1).max())
    lever = float(np.linalg.norm(ball[:3]) + ball[3])
    while body != j + 1:
        k = body - 1
        travel = max(abs(robot.lower[k]), abs(robot.upper[k])) + SLIDING_EXCESS if slides[k] else 0.0
        lever, body = lever + float(np.linalg.norm(tree.placements[k, :3, 3]) + travel), int(tree.parents[k])
    return lever


_ints = types.Array(types.int64, 1, "C", readonly=True)
_pairs = types.Array(types.int64, 2, "C", readonly=True)
_one, _two = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2))


@entry(
    types.boolean(
        _one, *tree_types, _ints, _one, _one, _one, types.int64, types.int64, _pairs, _two, *hull_types, types.float64,
        types.float64[::1], types.float64[::1],
    ),
    kinematics, *pairs_module.USES, pairs_module,
)  # fmt: skip
def _never(
    home: Array, parents: Index, placements: Array, axes: Array, supports: Array, end_bodies: Index, end_places: Array,
    joints: Index, levers: Array, low: Array, high: Array, i: int, j: int, index: Index, shapes: Array,
    vertices: Array, starts: Index, neighbours: Index, planes: Array, margin: float, memory: Array, work: Array,
) -> bool:  # fmt: skip
    """Whether a pair is nowhere nearer than the margin; boxes to be looked at stand on a stack, (low, high) of each."""
    n, k, free = parents.shape[0], end_bodies.shape[0], joints.shape[0]
    A, B = view(work, 0, (12,)), view(work, 12, (12,))
    rest, found = view(work, 24, (12 + WORK,)), view(work, 36 + WORK, (7,))
    stack = view(work, 43 + WORK, (_DEPTH, 2, MOST_JOINTS))
    q = view(work, 43 + WORK + 2 * MOST_JOINTS * _DEPTH, (n,))
    depth = 1
    for x in range(free):
        stack[0, 0, x], stack[0, 1, x] = low[x], high[x]
    for _ in range(BOXES):
        if depth == 0:
            return True
        depth -= 1
        spare, wide, widest = margin, 0, -1.0
        for x in range(n):
            q[x] = home[x]
        for x in range(free):
            half = 0.5 * (stack[depth, 1, x] - stack[depth, 0, x])
            q[joints[x]] = stack[depth, 0, x] + half
            spare += levers[x] * half
            if levers[x] * half > widest:
                wide, widest = x, levers[x] * half
        middle = q[joints[wide]]
        _forward(q, parents, placements, axes, supports, end_bodies, end_places, memory)
        poses = cut(memory, n, k)[0]
        pose_of(poses[index[i, BODY]], shapes[i], A)
        pose_of(poses[index[j, BODY]], shapes[j], B)
        found[0] = inf
        measured(
            A, index[i], shapes[i], B, index[j], shapes[j], vertices, starts, neighbours, planes, spare, rest, found
        )
        if found[0] > spare:
            continue
        if found[0] <= margin or depth + 2 > _DEPTH:
            return False
        for x in range(free):
            for side in range(2):
                stack[depth + 1, side, x] = stack[depth, side, x]
        stack[depth, 1, wide] = stack[depth + 1, 0, wide] = middle
        depth += 2
    return False
