"""Solids in two blocks for one compiled call, grouped by bodies, and the cheap tests that leave most pairs out."""

from __future__ import annotations

from itertools import groupby
from math import sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Vector, inline
from qpsafe.compiled.memory import view
from qpsafe.geometry.layout import BALL, BODY, CASE, FLOATS, INTEGERS, PLANES, PLANES_FROM
from qpsafe.geometry.measure import nearest_of, pairs_of
from qpsafe.geometry.pairs import pose_of

if TYPE_CHECKING:
    from qpsafe.geometry.solids import Solids
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]
Index = NDArray[np.int64]

shape_pose = pose_of
FEW = 16  # faces that are looked through one by one; of a hull with more its box is taken
_HEAD = 8  # joints, ends of the wire, shapes, groups, pairs, vertices, ends of edges, planes


class Tables(NamedTuple):
    """The solids: n joints, g shapes, m pairs in groups of the same two bodies.

    Attributes:
        numbers: The largest margin [m] (1,).
        margins: Of the pairs [m] (m,).
        balls: Around the shapes of each body, centre in its frame and radius (n + 1, 4); radius -1 for none.
        supports: 1 where joint j moves body i (n + 1, n).
        shapes, vertices, planes, index, starts, neighbours: As in `Solids`.
        groups: Two bodies, the first pair and how many, and the shape that all pairs have second, -1 if they differ
            (G, 5).
        pairs: (m, 2).
    """

    numbers: Any
    margins: Any
    balls: Any
    supports: Any
    shapes: Any
    vertices: Any
    planes: Any
    groups: Any
    pairs: Any
    index: Any
    starts: Any
    neighbours: Any


def tables_of(floats: Any, integers: Any) -> Tables:
    """Cut `Tables` from two blocks."""
    n, g, G, m = integers[0], integers[2], integers[3], integers[4]
    v, e, p = integers[5], integers[6], integers[7]
    a = 1 + m + 4 * (n + 1)
    b = a + (n + 1) * n
    c = b + FLOATS * g
    x = _HEAD + 5 * G
    y = x + 2 * m
    z = y + INTEGERS * g
    return Tables(
        view(floats, 0, (1,)),
        view(floats, 1, (m,)),
        view(floats, 1 + m, (n + 1, 4)),
        view(floats, a, (n + 1, n)),
        view(floats, b, (g, FLOATS)),
        view(floats, c, (v, 3)),
        view(floats, c + 3 * v, (p, 4)),
        view(integers, _HEAD, (G, 5)),
        view(integers, x, (m, 2)),
        view(integers, y, (g, INTEGERS)),
        view(integers, z, (v + 1,)),
        view(integers, z + v + 1, (e,)),
    )


cut_tables = inline(tables_of)


def blocks_of(solids: Solids, robot: Robot, pairs: Index, margin: float) -> tuple[Array, Index]:
    """The two blocks, read-only. A pair that is near at home already may come half as near as there.

    Args:
        solids: The solids.
        robot: The robot among them.
        pairs: Of its shapes and others (m, 2).
        margin: How near they may come [m].
    """
    bodies, n = solids.index[:, BODY], robot.nq
    known = np.arange(len(bodies)) >= len(bodies) - solids.known

    def group(pair: Any) -> tuple[int, int, int]:
        i, j = pair
        return int(bodies[i]), int(bodies[j]), int(j) if known[j] else -1

    ordered = sorted(pairs.tolist(), key=group)
    groups, first = [], 0
    for (a, b, shape), members in groupby(ordered, key=group):
        count = len(list(members))
        groups.append((a, b, first, count, shape))
        first += count
    poses, margins = robot.at(robot.home).body_poses(), np.full(len(pairs), margin)
    for k, pair in enumerate(ordered):
        at_home = nearest_of(solids.solid, poses, pairs_of([pair]), 2.0 * margin).distance
        margins[k] = min(margin, max(0.5 * at_home, 0.0))
    balls = np.zeros((n + 1, 4))
    for body in range(n + 1):
        chosen = solids.shapes[(bodies == body) & ~known, BALL:]
        balls[body] = _ball_around(chosen)
    floats = (np.array((margin,)), margins, balls, robot.tree.supports, solids.shapes, solids.vertices, solids.planes)
    counts = (
        n, robot.ends, len(bodies), len(groups), len(pairs), len(solids.vertices), len(solids.neighbours),
        len(solids.planes),
    )  # fmt: skip
    integers = (np.array(counts), np.array(groups), np.array(ordered), solids.index, solids.starts, solids.neighbours)
    blocks = (
        np.concatenate([np.ravel(part) for part in floats]).astype(float),
        np.concatenate([np.ravel(part) for part in integers]).astype(np.int64),
    )
    for block in blocks:
        block.flags.writeable = False
    return blocks


def _ball_around(balls: Array) -> Array:
    """A ball (centre, radius) around balls (b, 4); radius -1 around none."""
    if not len(balls):
        return np.array((0.0, 0.0, 0.0, -1.0))
    low, high = (balls[:, :3] - balls[:, 3:]).min(axis=0), (balls[:, :3] + balls[:, 3:]).max(axis=0)
    centre = 0.5 * (low + high)
    return np.append(centre, (np.linalg.norm(balls[:, :3] - centre, axis=1) + balls[:, 3]).max())


@inline
def apart(t: Any, poses: Any, shape: int, c: Vector, r: float, centre: Vector) -> bool:
    """Whether a ball (c, r) is certainly clear of a shape, whose own ball has this centre in the world."""
    x, y, z = c[0] - centre[0], c[1] - centre[1], c[2] - centre[2]
    most = r + t.shapes[shape, BALL + 3]
    if x * x + y * y + z * z > most * most:
        return True
    # the centre in the frame of the shape
    T, own = poses[t.index[shape, BODY]], t.shapes[shape]
    x, y, z = c[0] - T[0, 3], c[1] - T[1, 3], c[2] - T[2, 3]
    u = T[0, 0] * x + T[1, 0] * y + T[2, 0] * z
    v = T[0, 1] * x + T[1, 1] * y + T[2, 1] * z
    w = T[0, 2] * x + T[1, 2] * y + T[2, 2] * z
    first, count = t.index[shape, PLANES_FROM], t.index[shape, PLANES]
    if count <= FEW:
        for k in range(first, first + count):
            if t.planes[k, 0] * u + t.planes[k, 1] * v + t.planes[k, 2] * w + t.planes[k, 3] > r:
                return True
        return False
    x = max(abs(u - own[CASE]) - own[CASE + 3], 0.0)
    y = max(abs(v - own[CASE + 1]) - own[CASE + 4], 0.0)
    z = max(abs(w - own[CASE + 2]) - own[CASE + 5], 0.0)
    return sqrt(x * x + y * y + z * z) > r
