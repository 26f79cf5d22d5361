"""True distances of the robot to people, to furniture, to the floor and to itself, for Python."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.sim.engine import layout
from qpsafe.sim.engine.nearest import PAIR, nearest_pair, robot_to_people

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.engine.world import World

Array = NDArray[np.float64]
Index = NDArray[np.int64]

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


class Distances:
    """Measures distances in a world; it owns what the kernels work in.

    What is fixed to the world is not measured against furniture and floor: it cannot come nearer.

    Args:
        world: The world.
        robot: Its robot.

    Attributes:
        world: The world.
        furniture: Pairs of shapes of which one is the robot's and one a piece of furniture, (m, 2).
        floors: Likewise with planes.
    """

    def __init__(self, world: World, robot: Robot) -> None:
        self.world = world
        bodies = world.index[:, layout.BODY]
        moving = [i for i in world.robot.tolist() if bodies[i] != 0]
        self.furniture = _pairs([(i, j) for i in moving for j in world.furniture.tolist()])
        self.floors = _pairs([(i, j) for i in moving for j in world.floors.tolist()])
        self._robot = robot

    @cached_property
    def own(self) -> Index:
        """Pairs of the robot's shapes, on bodies that are neither the same nor joined, and apart at home, (m, 2)."""
        world, robot, bodies = self.world, self._robot, self.world.index[:, layout.BODY]
        parents = [0, *robot.tree.parents.tolist()]
        apart = [
            (i, j)
            for k, i in enumerate(world.robot.tolist())
            for j in world.robot.tolist()[:k]
            if bodies[i] != bodies[j] and parents[bodies[i]] != bodies[j] and parents[bodies[j]] != bodies[i]
        ]
        poses = robot.at(robot.home).body_poses()
        return _pairs([pair for pair in apart if self.pairs(poses, _pairs([pair])).distance > TOUCHING])

    def people(self, poses: Array, people: tuple[Array, ...], at_most: float = np.inf) -> Nearest:
        """Smallest distance of the robot to anybody's body or board.

        Args:
            poses: Of the world's bodies, (b, 4, 4) [m].
            people: A row of `PersonTracks`.
            at_most: Larger distances are not looked for [m].
        """
        work = np.empty(PAIR + len(self.world.robot) * (len(people[1]) + len(people[3])))
        found = np.full(7, np.nan)
        shape, other = robot_to_people(
            np.ascontiguousarray(poses), self.world.robot, *self.world.solid, *people, at_most, work, found
        )
        return Nearest(float(found[0]), found[1:4], found[4:], shape, other)

    def pairs(self, poses: Array, pairs: Index, at_most: float = np.inf) -> Nearest:
        """Smallest distance over some pairs of shapes, such as `furniture`, `floors` or `own`.

        Args:
            poses: Of the world's bodies, (b, 4, 4) [m].
            pairs: Numbers of shapes, (m, 2).
            at_most: Larger distances are not looked for [m].
        """
        found = np.full(7, np.nan)
        work = np.empty(PAIR + 3 * len(self.world.names) + len(pairs))
        p = nearest_pair(np.ascontiguousarray(poses), pairs, *self.world.solid, at_most, work, found)
        shape, other = pairs[p].tolist() if p >= 0 else (-1, -1)
        return Nearest(float(found[0]), found[1:4], found[4:], shape, other)


def _pairs(rows: ArrayLike) -> Index:
    pairs = np.array(rows, dtype=np.int64).reshape(-1, 2)
    pairs.flags.writeable = False
    return pairs
