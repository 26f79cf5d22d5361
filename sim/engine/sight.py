"""Perfect sight: where everybody is nearest to each link of the robot, whatever hides them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.sensing.detection import nearest_link
from qpsafe.sim.engine.bodies import Bodies

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.sim.engine.world import World

Array = NDArray[np.float64]

SIGHT = 2.0  # how far perfect sight looks [m]


class Sight:
    """Sees all of everybody.

    Args:
        world: The world.
        robot: Its robot.

    Attributes:
        bodies: The robot's moving bodies.
    """

    def __init__(self, world: World, robot: Robot) -> None:
        self.bodies = Bodies(world, robot)
        self._link_bodies = np.array([robot.mounting(end)[0] for _, end in robot.wire_frames])

    def points(self, state: RobotState, people: tuple[Array, ...]) -> Array:
        """Where everybody is nearest to each link (p, 3) [m], as far as `SIGHT`.

        A point belongs to the link of the wire that it is nearest to, as points given to a controller do; it counts if
        it is the nearest one of this link's body, so that nobody counts once for every body of the robot.

        Args:
            state: The robot.
            people: A row of `PersonTracks`.
        """
        near = self.bodies.to_people(state, people, SIGHT)
        if not len(near.distance):
            return near.on_other
        links = nearest_link(near.on_other, state.wire(np.zeros_like(state.q)))
        return near.on_other[self._link_bodies[links] == near.body]
