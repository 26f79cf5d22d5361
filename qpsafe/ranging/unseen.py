"""What several sensors know together: what one looks through is free, what none of them sees may be occupied."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.fusion import LookingThrough
from qpsafe.ranging.reduction.candidates_kernel import LOST, STAMP, VELOCITY, WRONG, lost_before
from qpsafe.sensing.hulls import HullSet

if TYPE_CHECKING:
    from qpsafe.ranging.reduction.reduce import Reducer
    from qpsafe.robot.wire import Wire

Array = NDArray[np.float64]

#: Places around a link that are asked for: along its axis, and how far away from it [m].
ALONG, AWAY = (0.0, 0.5, 1.0), (0.2, 0.35, 0.5)
#: A place stands for what is as near to it as that [m].
HALF = 0.1
_CORNERS = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], dtype=float)
_AROUND = _CORNERS / np.linalg.norm(_CORNERS, axis=1, keepdims=True)


class View(NamedTuple):
    """The last image of a sensor.

    Attributes:
        stamp: When it was taken [s].
        pose: Of the sensor then (4, 4).
        distances, valid, sigma: Of its zones, or tiles (z,).
    """

    stamp: float
    pose: Array
    distances: Array
    valid: NDArray[np.bool_]
    sigma: Array


class Together:
    """Looks through the images of several sensors.

    Args:
        reducers: Of all sensors.
        tolerance: That a reading has to be farther than a place to be looking through it [m].
        deviations: By how many standard deviations a reading may be wrong.
        hulls: The robot itself and known obstacles: nobody is in them.
        person: How fast people come [m/s].
        room: How many points all sensors have at most.
        mounts: Body that carries each sensor, and its pose there.
        running: a_h and the fastest anybody becomes, see `person_speed` [m/s², m/s].
    """

    def __init__(
        self, reducers: list[Reducer], tolerance: float, deviations: float, hulls: HullSet, person: float, room: int,
        mounts: Sequence[tuple[int, Array]], running: tuple[float, float],
    ) -> None:  # fmt: skip
        self._lookers = [LookingThrough(reducer.zones, tolerance, deviations) for reducer in reducers]
        self._hulls, self._person, self._tolerance = hulls, person, tolerance
        self._mounts, self._running = mounts, running
        self._reach = [reducer.zones.range_max for reducer in reducers]
        self._covers = [reducer.zones.covers for reducer in reducers]
        self._reducers, self._zones = reducers, [len(reducer.zones.directions) for reducer in reducers]
        self._found = np.empty((room, 2), dtype=np.int64)
        self.reset()

    def reset(self) -> None:
        """Forget all images."""
        self.views: list[View | None] = [None] * len(self._lookers)

    def take(self, who: int, stamp: float, pose: Array, store: Array, counts: NDArray[np.int64], person: float) -> None:
        """Take a usable image; points that others have lost, and that it looks through, are forgotten.

        A lost point may have moved since it was seen, by max(v_h, |ṗ| + a_h t) t: all of what it can have reached has
        to be looked through.

        Args:
            who: Number of the sensor.
            stamp: Of its image [s].
            pose: Of the sensor then (4, 4).
            store: Points of all sensors (s, r, WIDTH).
            counts: How many points each holds (s,).
            person: How fast people come now, see `_fastest` [m/s].
        """
        reducer = self._reducers[who]
        self.views[who] = View(stamp, pose, reducer.distances.copy(), reducer.valid.copy(), reducer.sigma.copy())
        count = lost_before(store, counts, who, stamp, self._found)
        if count:
            sensors, rows = self._found[:count].T
            points = store[sensors, rows]
            elapsed, (acceleration, fastest) = stamp - points[:, STAMP], self._running
            known = np.linalg.norm(points[:, VELOCITY : VELOCITY + 3], axis=1)
            known = np.where(known > 0.0, np.minimum(known + acceleration * elapsed, fastest), 0.0)
            errors = points[:, WRONG] + np.maximum(known, self._fastest(person)) * elapsed
            through = self._through(who, np.ascontiguousarray(points[:, :3]), errors)
            store[sensors[through], rows[through], LOST] = -np.inf

    def _fastest(self, person: float) -> float:
        """How fast people come [m/s]: as was given at first, or now, where the gate knows of faster ones."""
        return max(self._person, person)

    def _through(self, who: int, points: Array, errors: Array) -> NDArray[np.bool_]:
        view = self.views[who]
        if view is None:
            return np.zeros(len(points), dtype=np.bool_)
        return self._lookers[who](points, errors, view.pose, view.distances, view.valid, view.sigma)

    def unseen(self, wire: Wire, poses: Array, now: float, person: float) -> Array:
        """Places near the robot that a sensor covers and that none looks through, nor anything known fills (p, 3) [m].

        Somebody may be there. Places are asked for around every link, see `ALONG` and `AWAY`, `HALF` apart.

        Args:
            wire: Of the robot now.
            poses: Of its bodies now (b, 4, 4).
            now: Present time [s].
            person: How fast people come now, see `_fastest` [m/s].
        """
        axes = wire.ends - wire.starts
        along = (wire.starts[:, None] + np.array(ALONG)[:, None] * axes[:, None]).reshape(-1, 1, 1, 3)
        places = (along + np.array(AWAY)[:, None, None] * _AROUND).reshape(-1, 3)
        places = places[self._hulls.find(places, np.full(len(places), self._tolerance), poses) < 0]
        covered = np.zeros(len(places), dtype=np.bool_)
        for who, view in enumerate(self.views):
            if self._covers[who]:  # where it was at its last image, or is now if it never sent one
                body, place = self._mounts[who]
                nothing = np.full(self._zones[who], np.inf)
                all_of_them = np.ones(len(nothing), dtype=np.bool_)
                pose = poses[body] @ place if view is None else view.pose
                covered |= self._lookers[who](places, 0.0, pose, nothing, all_of_them, 0.0)
        places = places[covered]
        for who, view in enumerate(self.views):
            if view is not None and len(places):
                moved = HALF + self._fastest(person) * (now - view.stamp)
                places = places[~self._through(who, places, np.full(len(places), moved))]
        return places
