"""Are these metres? Readings that no such sensor can give, again and again, are centimetres or millimetres.

A sensor that gives 42.0 for 42 cm, or points in millimetres, make the robot blind without anything being wrong with a
single reading: what lies beyond the range is healthy. But lengths have a scale. Sensors on a robot's skin reach some
metres, and the shortest distance that the paper's measures, 0.15 m, is 15 in centimetres; what sees points around a
robot reaches some tens of metres, and a cell's points in millimetres lie hundreds from its base. So a finite reading
beyond `FARTHEST_READING` (or twice the range, if that is more), or points that all lie beyond `FARTHEST_POINT`, for
`LASTING`, is said to be in another unit. One reading that may be metres begins the time anew; +inf says nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, entry, inline, readable
from qpsafe.sensing.skin.spots import SpotArray

#: Readings [m], and points from the world's origin [m], that nothing of their kind tells.
FARTHEST_READING, FARTHEST_POINT = 10.0, 100.0
#: For this long [s], looked at this many times.
LASTING, LOOKS = 1.0, 5


@inline
def count_far(distances: Array, farthest: Array, counts: Array, noticed: Array) -> bool:
    """Count the looks (k,) in which each spot's reading was too large for metres; whether one more was noticed (k,)."""
    more = False
    for k in range(distances.shape[0]):
        if farthest[k] < distances[k] < np.inf:
            counts[k] += 1
        elif 0.0 <= distances[k] <= farthest[k]:
            counts[k] = 0
        if counts[k] >= LOOKS and not noticed[k]:
            noticed[k] = more = True
    return more


@inline
def all_far(points: Array) -> bool:
    """Whether points (p, 3) all lie too far away to be metres."""
    far = True
    for k in range(points.shape[0]):
        far = far and max(abs(points[k, 0]), abs(points[k, 1]), abs(points[k, 2])) > FARTHEST_POINT
    return far


@entry(types.boolean(readable(1), readable(1), types.int64[::1], types.boolean[::1]))
def _count_far(distances: Array, farthest: Array, counts: Array, noticed: Array) -> bool:
    return count_far(distances, farthest, counts, noticed)


@entry(types.boolean(readable(2)))
def _all_far(points: Array) -> bool:
    return all_far(points)


class UnitWatch:
    """Watches what is given to `SafetyController.step`; what it has noticed stays until acknowledged.

    Args:
        spots: The distance sensors, or None.
        dt: Tick [s].

    Attributes:
        odd: Names of the spots that it has noticed: nobody knows what is in front of them.
    """

    def __init__(self, spots: SpotArray | None, dt: float) -> None:
        self._names = () if spots is None else spots.names
        ranges = np.zeros(0) if spots is None else np.asarray(spots.range_max, dtype=float)
        self.farthest = np.maximum(FARTHEST_READING, 2.0 * ranges)
        self.every = max(round(LASTING / LOOKS / dt), 1)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._tick = 0
        self.odd: tuple[str, ...] = ()
        self._notes: tuple[str, ...] = ()
        self._counts = np.zeros(len(self._names), dtype=np.int64)
        self._noticed = np.zeros(len(self._names), dtype=np.bool_)
        self._points = 0

    #: A person has looked: what goes on will be noticed again.
    acknowledge = reset

    def notes(self, distances: Any, points: Any) -> tuple[str, ...]:
        """What is odd, in words that change only when another spot joins; input as given to `step`, and accepted."""
        self._tick += 1
        if self._tick % self.every == 0:
            given = distances if points is None else points
            if given is None:  # images only
                return self._notes
            try:  # a copy: what a user gave may change while it is read, and compiled code does not look at sizes
                array = np.array(given, dtype=float)
            except Exception:  # it is not any more what the tick has accepted
                return self._notes
            if array.shape == self._counts.shape and points is None:
                self._look_at_readings(array)
            elif array.ndim == 2 and array.shape[1] == 3:
                self._look_at_points(array)
        return self._notes

    def _look_at_readings(self, distances: np.ndarray) -> None:
        if _count_far(distances, self.farthest, self._counts, self._noticed):
            noticed = self._noticed
            self.odd = tuple(self._names[i] for i in noticed.nonzero()[0])
            who = ", ".join(self.odd)
            self._say(f"only readings beyond {FARTHEST_READING:g} m, which no such sensor tells: {who}")

    def _look_at_points(self, points: np.ndarray) -> None:
        if len(points):
            self._points = self._points + 1 if _all_far(points) else 0
            if self._points == LOOKS:
                self._say(f"all points beyond {FARTHEST_POINT:g} m from the origin")

    def _say(self, what: str) -> None:
        meant = "are these centimetres or millimetres? metres are wanted, +inf where nothing is in sight"
        self._notes = (f"{what}; {meant}",)
