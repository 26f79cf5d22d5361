"""One trial from its first detection on: which joint motions are possible, and how near people come."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.geometry.layout import BODY
from qpsafe.limits import JointLimits
from qpsafe.sim.campaign.limit.people_along import PeopleAlong
from qpsafe.sim.campaign.limit.rollout import roll_out
from qpsafe.sim.campaign.trials.closest import PairsAlong
from qpsafe.sim.campaign.trials.servo import DT

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.recording import Recording
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.sim.engine.tracks import PersonTracks

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ROUGH = 1e-3  # by how much a distance may be told too large while motions are compared [m]
TOUCHING = -1.0  # what touches furniture, or the robot itself, is worse than the deepest contact with people [m]


class Escape:
    """A robot in the state in which it first saw anybody, and people whose motion is known.

    Args:
        station: What the robot does where.
        tracks: Everybody.
        run: Of the controller whose state it is.
        first: Tick of the first command that can be chosen.
        lag: Of the servos [s].

    Attributes:
        robot: The robot.
        first: As given.
        people: Everybody, to be measured along runs.
        before: Smallest distance up to the first command [m].
        fixed: Smallest distance that no motion can change [m]: before the first command takes effect, and to the base.
    """

    def __init__(
        self, station: Station, tracks: PersonTracks, run: Recording, first: int, lag: float = 0.0
    ) -> None:  # fmt: skip
        self.robot, self.first, self._delay = station.robot, first, round(lag / DT)
        self._run = np.array((run.q, run.qd, run.reference_q, run.reference_qd))
        self._limits = JointLimits.of(station.robot, DT)
        n = station.robot.nq
        self._work = np.empty((2, n)), np.empty((3, n), dtype=np.int64)
        self.people, pairs = PeopleAlong(station, tracks), station.distances
        self._pairs = PairsAlong(
            station, np.concatenate((pairs.furniture, pairs.floors, pairs.own)), np.ascontiguousarray(run.q[first])
        )
        bodies = station.world.index[station.world.robot, BODY]
        self.before = self.people.smallest(run.q[: first + 1])
        base = PeopleAlong(station, tracks, np.ascontiguousarray(station.world.robot[bodies == 0]))
        self.fixed = min(base.smallest(run.q), self.people.smallest(run.q[: first + 1 + self._delay]))

    def motion(self, goals: Array, since: Index) -> Array:
        """The motion towards goals as fast as the limits allow: measured q and q̇, reference q and q̇ (4, T, n).

        Args:
            goals: Joint positions, one after the other, (g, n) [rad].
            since: How many ticks after the first command each begins to be the goal, the first one 0, (g,).
        """
        return self._rolled(goals, since).copy()

    def _rolled(self, goals: Array, since: Index) -> Array:
        limits = self._limits
        roll_out(
            goals, since + self.first, limits.table, limits.return_speed, self.first, self._delay, self._run,
            *self._work,
        )  # fmt: skip
        return self._run

    def compared(self, goals: Array, since: Index, enough: float = -inf) -> float:
        """How good a motion towards goals is, for a search: its smallest distance to people, within `ROUGH` [m].

        Args:
            goals: See `motion`.
            since: See `motion`.
            enough: Below that it need not be exact [m].
        """
        q = self._rolled(goals, since)[0, self.first :]
        distance = self.people.smallest(q, self.first, tolerance=ROUGH, enough=enough)
        if distance < enough:
            return distance
        depth = self._pairs.smallest(q, 0.0)
        return distance if depth >= 0.0 else TOUCHING + min(distance, 0.0) + depth

    def distance(self, run: Array) -> float:
        """Smallest distance to people in the whole encounter [m]; -inf if furniture, floor or the robot are touched.

        Args:
            run: Measured q and q̇, reference q and q̇ (4, T, n), which leave the state at the first command as it is.
        """
        q = run[0, self.first :]
        clear = self._pairs.smallest(q, 0.0) >= 0.0
        return min(self.people.smallest(q, self.first), self.before) if clear else -inf

    def begins(self, run: Array) -> bool:
        """Whether a run has the state at the first command that this one has, to the last bit.

        Args:
            run: As for `distance`.
        """
        known: Any = slice(max(self.first - self._delay - 1, 0), self.first)
        same = run[2:, known].tobytes() == self._run[2:, known].tobytes()
        return same and run[:2, self.first].tobytes() == self._run[:2, self.first].tobytes()
