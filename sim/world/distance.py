"""The smallest true distances between the robot and the boards, and between the robot and people's bodies.

Measured by the engine. It was compared with MuJoCo and coal: what is apart agrees within their tolerances, and overlaps
are called so by all three.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.geometry.layout import BODY
from qpsafe.sim.engine.tracks import people_of
from qpsafe.sim.engine.world import World

if TYPE_CHECKING:
    from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]


class Distance(NamedTuple):
    """A smallest distance and where it is.

    Attributes:
        distance: Negative when the two overlap, +inf if there is no other [m].
        on_robot: Nearest point of the robot, world frame, (3,) [m].
        on_other: Nearest point of the board or the person, (3,) [m].
        body: Body of the robot's tree that the point is on, 0 for the base; -1 for none.
    """

    distance: float
    on_robot: Array
    on_other: Array
    body: int


class TrueDistances:
    """Smallest distances of the robot's collision geoms to what is in a scene.

    Args:
        scene: The scene.
        moving: Whether only links that move are measured, without the foot that is bolted down.
    """

    def __init__(self, scene: Scene, moving: bool = False) -> None:
        from qpsafe.sim.engine.distances import Distances  # compiled when there is something to be measured

        world = World.of(scene)
        if moving:
            world = replace(world, robot=world.robot[world.index[world.robot, BODY] != 0])
        self._scene, self._distances = scene, Distances(world, scene.robot)

    def measure(self, data: Any) -> tuple[Distance, Distance]:
        """To the nearest board and to the nearest body, boards not counted; geom poses are up to date.

        The robot's shapes stand where the kinematics of its joints has them.
        """
        scene, measured = self._scene, self._distances
        ends, radii, balls, boards, half_sizes = people_of(scene, data)
        poses = measured.world.poses(scene.robot.at(data.qpos[scene.q_addresses]))
        found = (
            measured.people(poses, people)
            for people in (
                (ends[:0], radii[:0], balls[:0], boards, half_sizes),
                (ends, radii, balls, boards[:0], half_sizes[:0]),
            )
        )
        owners = measured.world.index[:, BODY]
        board, person = (
            Distance(n.distance, n.on_robot, n.on_other, int(owners[n.shape]) if n.shape >= 0 else -1) for n in found
        )
        return board, person

    def board(self, data: Any) -> Distance:
        """To the nearest board, see `measure`."""
        return self.measure(data)[0]

    def person(self, data: Any) -> Distance:
        """To the nearest body, see `measure`."""
        return self.measure(data)[1]
