"""The smallest distance over pairs of shapes, for Python, and which shapes of a robot may touch each other."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.geometry.layout import BODY, frozen
from qpsafe.geometry.pairs import PAIR, nearest_pair

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Solid = tuple[Index, Array, Array, Index, Index, Array]  # index, shapes, vertices, starts, neighbours, planes

TOUCHING = 1e-6  # what is nearer than that touches at home [m]


class Nearest(NamedTuple):
    """A smallest distance and where it is.

    Attributes:
        distance: Negative when the two overlap, +inf if it is larger than asked for [m].
        on_robot: Nearest point on the robot, world frame, (3,) [m].
        on_other: Nearest point on what it is near to, (3,) [m].
        shape: Number of the robot's shape in the world, -1 for none.
        other: Number of the other shape; of people: that of the capsule, or of capsules + that of the board.
    """

    distance: float
    on_robot: Array
    on_other: Array
    shape: int
    other: int


def nearest_of(solid: Solid, poses: Array, pairs: Index, at_most: float = np.inf) -> Nearest:
    """Smallest distance over some pairs of shapes.

    Args:
        solid: Tables of the shapes: index, shapes, vertices, starts, neighbours, planes.
        poses: Of the bodies, (b, 4, 4) [m].
        pairs: Numbers of shapes, (m, 2).
        at_most: Larger distances are not looked for [m].
    """
    found = np.full(7, np.nan)
    work = np.empty(PAIR + 3 * len(solid[0]) + len(pairs))
    p = nearest_pair(np.ascontiguousarray(poses), pairs, *solid, at_most, work, found)
    shape, other = pairs[p].tolist() if p >= 0 else (-1, -1)
    return Nearest(float(found[0]), found[1:4], found[4:], shape, other)


def pairs_of(rows: Iterable[tuple[int, int]]) -> Index:
    """Pairs of numbers as a read-only array, (m, 2)."""
    return frozen(np.array(list(rows), dtype=np.int64).reshape(-1, 2), np.int64)


def apart_at_home(solid: Solid, robot: Robot, pairs: Iterable[tuple[int, int]]) -> Index:
    """Those pairs of shapes that do not touch at the robot's home, (m, 2): what touches there is mounted so.

    Args:
        solid: Tables of the shapes, as for `nearest_of`.
        robot: The robot.
        pairs: Numbers of shapes.
    """
    poses = robot.at(robot.home).body_poses()
    return pairs_of(p for p in pairs if nearest_of(solid, poses, pairs_of([p]), TOUCHING).distance > TOUCHING)


def own_pairs(solid: Solid, robot: Robot, chosen: Index) -> Index:
    """Pairs of the robot's shapes on bodies that are neither the same nor joined, and apart at home, (m, 2).

    Args:
        solid: Tables of the shapes, as for `nearest_of`.
        robot: The robot.
        chosen: Numbers of its shapes, those of its base included, (r,).
    """
    bodies, parents = solid[0][:, BODY], [0, *robot.tree.parents.tolist()]
    return apart_at_home(
        solid,
        robot,
        (
            (i, j)
            for k, i in enumerate(chosen.tolist())
            for j in chosen.tolist()[:k]
            if bodies[i] != bodies[j] and parents[bodies[i]] != bodies[j] and parents[bodies[j]] != bodies[i]
        ),
    )
