"""True distances of the robot to people, to furniture, to the floor and to itself, for Python."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.geometry import layout
from qpsafe.geometry.measure import Nearest, nearest_of, own_pairs, pairs_of
from qpsafe.geometry.pairs import PAIR
from qpsafe.sim.engine.nearest import robot_to_people

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.engine.world import World

Array = NDArray[np.float64]
Index = NDArray[np.int64]


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
        self.furniture = pairs_of([(i, j) for i in moving for j in world.furniture.tolist()])
        self.floors = pairs_of([(i, j) for i in moving for j in world.floors.tolist()])
        self._robot = robot

    @cached_property
    def own(self) -> Index:
        """Pairs of the robot's shapes, on bodies that are neither the same nor joined, and apart at home, (m, 2)."""
        return own_pairs(self.world.solid, self._robot, self.world.robot)

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
        return nearest_of(self.world.solid, poses, pairs, at_most)
