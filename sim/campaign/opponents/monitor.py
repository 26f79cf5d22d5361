"""Speed and separation monitoring of every link against every seen point: what stop and scaling have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.separation import Separation
from qpsafe.sensing.detection import BadInput
from qpsafe.sim.campaign.opponents.as_in_paper import AS_IN_PAPER
from qpsafe.sim.engine.bodies import Bodies

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.station import Station

Array = NDArray[np.float64]

FAR = 2.0  # beyond this from the robot nothing limits its speed: v_max is above 2 m/s there [m]


class Gaps(NamedTuple):
    """Every moving body of the robot against every seen point, those within `FAR` of each other.

    Attributes:
        distances: Between the body's true shape and the point (k,) [m].
        rows: nᵀ J of the body's nearest point (k, n), n towards the seen point: times q̇ the speed of approach.
    """

    distances: Array
    rows: Array


class Monitor:
    """Sees points and tells how near, and how fast nearer, every body of the robot comes to each of them.

    Args:
        station: With robot, sensors and scene.
        separation: Figures of the monitor; by default a_s as measured for the station's motion.
    """

    def __init__(self, station: Station, separation: Separation | None = None) -> None:
        self.separation = station.separation if separation is None else separation
        self.robot = station.robot
        self._bodies = Bodies(station.world, station.robot)
        controller = station.controller(**AS_IN_PAPER)
        self._sensing, self._ranging, self._field = controller.sensing, controller.ranging, controller.field
        #: Points seen at the last tick (p, 3) [m].
        self.seen = np.empty((0, 3))

    def gaps(
        self, q: Array, qd: Array, distances: ArrayLike | None, points: ArrayLike | None, images: Any = None,
        now: float = 0.0,
    ) -> Gaps | None:  # fmt: skip
        """What is near; None where too many sensors cannot be trusted.

        Args:
            q: Measured (n,) [rad].
            qd: Measured (n,) [rad/s].
            distances: Of the spots (k,) [m].
            points: Instead (p, 3) [m].
            images: Of range sensors, beside distances or in their place.
            now: Present time on the clock of their stamps [s].
        """
        state = self.robot.at(q)
        if distances is None and points is None:
            seen = np.empty((0, 3))
        elif distances is None:
            seen = np.asarray(points, dtype=float).reshape(-1, 3)
        elif self._sensing is None:
            raise BadInput("distances are given but the robot has no spots")
        else:
            found = self._sensing.update(state, state.wire(qd), np.asarray(distances, dtype=float))
            if found.too_many:
                return None
            seen = found.points
        if self._ranging is not None and images is not None:
            try:
                where = q, state.body_poses(), state.wire(qd)
                seen = np.concatenate((seen, self._ranging.update(images, now, *where, self._field).near))
            except BadInput:
                return None
        self.seen = seen
        near = self._bodies.to_points(state, seen, FAR)
        return Gaps(near.distance, near.rows)
