"""Speed and separation monitoring as rows of the QP, and nothing else: no field, no evasion, no gate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.field import DangerField
from qpsafe.danger.separation import Separation
from qpsafe.danger.separation_limit import SeparationLimit
from qpsafe.recovery.recovery import FOLLOWING, SUSPENDED
from qpsafe.sim.campaign.opponents.scaling import Clocked

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.tick import Tick

Array = NDArray[np.float64]

FREE = 0.005  # a tool with errors up to this is on its path: it follows a tick late [m, rad]
LAG = 0.015  # from this error on the path stands still [m, rad]
_STANDS = 0.05  # a path that goes more slowly than this share of its speed counts as suspended


class Separated:
    """Follows the path as far as no link approaches anybody faster than v_max; the path waits for a tool that is held.

    Args:
        station: What the robot does.
        separation: Figures of the limit; measured ones by default.
    """

    def __init__(self, station: Station, separation: Separation | None = None) -> None:
        self._clock = Clocked(station.reference)
        self._controller = station.controller(
            trajectory=self._clock,
            field=DangerField(static=0.0, kinetic=0.0),
            separation=SeparationLimit(station.separation if separation is None else separation),
            gate="off",
            clearance="off",
        )
        self._tolerance = self._controller.recovery_rules.tolerance

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
        tick, clock = self._controller.step(q, qd, distances, points=points, images=images, now=now), self._clock
        # of every task; none where the robot only brakes
        behind = max([float(np.linalg.norm(error)) for error in tick.errors], default=np.inf)
        clock.rate = min(max((LAG - behind) / (LAG - FREE), 0.0), 1.0)
        clock.advance(self._controller.dt, lambda: behind <= self._tolerance)
        tick.phase = FOLLOWING if clock.rate > _STANDS else SUSPENDED
        tick.path_time = clock.time
        return tick
