"""Stop-only monitoring: what cells do today. Too near for its speed, the robot brakes and stands until there is room.

Made as strong as we could: the exact S_p of the actual approach speed of every body against every seen point, its true
shape, braking at the joints' limits at once, and work that goes on by itself, back to the path where it was left.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.separation import Separation
from qpsafe.pipeline.braking import slower
from qpsafe.recovery.recovery import SUSPENDED
from qpsafe.reference import JointReference
from qpsafe.sim.campaign.opponents.as_in_paper import AS_IN_PAPER
from qpsafe.sim.campaign.opponents.monitor import Monitor

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.tick import Tick

Array = NDArray[np.float64]


class StopOnly:
    """Follows the path, or stops.

    Args:
        station: What the robot does.
        separation: Figures of the monitor; measured ones by default.
        hysteresis: How much farther than S_p at the nominal speed everybody must be for the robot to go on [m].
    """

    def __init__(self, station: Station, separation: Separation | None = None, hysteresis: float = 0.05) -> None:
        self._controller = station.controller(range_sensors=(), **AS_IN_PAPER)
        self._monitor = Monitor(station, separation)
        self._again = float(self._monitor.separation.distance(station.speed)) + hysteresis
        self._robot, self._dt = station.robot, self._controller.dt
        self._stopping = False
        self._tick: Tick | None = None

    def step(
        self, q: Array, qd: Array, distances: ArrayLike | None = None, *, points: ArrayLike | None = None,
        images: Any = None, now: float = 0.0,
    ) -> Tick:  # fmt: skip
        """One tick, as `SafetyController.step`.

        Args:
            q: Measured (n,) [rad].
            qd: Measured (n,) [rad/s].
            distances: Of the spots (k,) [m].
            points: Instead (p, 3) [m].
            images: Of range sensors.
            now: Present time on the clock of their stamps [s].
        """
        gaps = self._monitor.gaps(q, qd, distances, points, images, now)
        if self._tick is None:
            free = True  # at rest
        elif gaps is None:
            free = False
        else:
            free = bool((gaps.rows @ self._tick.reference.qd <= self._monitor.separation.speed(gaps.distances)).all())
        if not self._stopping and free:
            self._tick = self._controller.step(q, qd, points=_NOBODY)
            self._tick.points = self._monitor.seen
            return self._tick
        assert self._tick is not None
        self._stopping = True
        last = self._tick.reference
        command = slower(self._controller.limits, last.qd)  # type: ignore[arg-type]
        reference = JointReference(
            last.seq + 1, last.time + self._dt, last.q + command * self._dt, command, last.active
        )
        self._tick = replace(self._tick, reference=reference, phase=SUSPENDED, events=(), points=self._monitor.seen)
        # so do the joints, which may lag behind
        at_rest = not command.any() and np.abs(qd).max() < STANDS and np.abs(q - reference.q).max() < ARRIVED
        if at_rest and gaps is not None and (gaps.distances >= self._again).all():
            self._controller.reseed()  # back to the path, whose clock stood still
            self._stopping = False
        return self._tick


STANDS, ARRIVED = 1e-3, 1e-4  # [rad/s], [rad]
_NOBODY = np.empty((0, 3))
