"""Footsteps for a given walk: feet that stand still on the floor until they step.

The walk (position and heading as functions of time) is known beforehand, so the steps are planned once: whenever both
feet stand, the one that will be farthest from where it should be half a stance later swings there. Walking forwards,
backwards, sideways and turning on the spot all come out of this one rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.person import Foot, Person

Array = NDArray[np.float64]
Walk = Callable[[Array], tuple[Array | float, Array | float, Array | float]]

WAIT = 0.02  # feet that stand look again after this time [s]
LOOK = 4  # instants looked at at once, at first


class Step(NamedTuple):
    """One swing of one foot.

    Attributes:
        start, end: [s].
        origin, goal: Where the foot leaves the floor and where it lands.
    """

    start: float
    end: float
    origin: Foot
    goal: Foot


class Footsteps:
    """Planned steps of both feet, and where the feet are at any time."""

    def __init__(
        self,
        person: Person,
        walk: Walk,
        duration: float,
        *,
        swing: float = 0.44,
        stand: float = 0.11,
        lift: float = 0.055,
        pace: Callable[[Array], tuple[Array, Array]] | None = None,
    ) -> None:
        """Plan the steps.

        Args:
            person: Whose feet.
            walk: Times (T,) [s] -> x [m], y [m], heading [rad], each (T,) or a number.
            duration: Of the walk [s].
            swing: Time a foot is in the air [s].
            stand: Time both feet stand between two steps [s].
            lift: Height of a full step [m].
            pace: Times (T,) [s] -> `swing` and `stand` then, (T,) each, for people who walk at many speeds.
        """
        self._person, self._walk, self._lift, self._duration = person, walk, lift, duration
        self._pace = pace or (lambda times: (np.full_like(times, swing), np.full_like(times, stand)))
        self._first = person.standing(self._roots(np.zeros(1)))[0]
        self.steps: tuple[list[Step], list[Step]] = ([], [])
        self._plan()
        self._rows = tuple(self._table(side) for side in (0, 1))

    def _roots(self, times: Array) -> Array:
        """Of the walk (T, 3)."""
        return np.stack(np.broadcast_arrays(*self._walk(times), times)[:3], axis=-1)

    def _plan(self) -> None:
        """Find the steps; while the feet may stand, look ahead over ever more instants at once."""
        feet, last, time, count = self._first, 1, 0.0, LOOK
        while time < self._duration:
            times = np.cumsum([time, *[WAIT] * (count - 1)])
            fly, rest = self._pace(times)
            ahead = fly + fly / 2 + rest  # middle of the stance that follows a swing which starts then
            wanted = self._person.standing(self._roots(np.minimum(times + ahead, self._duration)))
            errors = _separation(feet, wanted)
            sides = np.where(np.abs(errors[:, 0] - errors[:, 1]) > 0.05, errors[:, 1] > errors[:, 0], 1 - last)
            moved = np.flatnonzero((errors[np.arange(count), sides] >= 0.035) & (times < self._duration))
            if len(moved) == 0:
                time, count = float(times[-1]) + WAIT, min(4 * count, 64 * LOOK)
                continue
            k, count = int(moved[0]), LOOK
            last, start, end = int(sides[k]), float(times[k]), float(times[k] + fly[k])
            origin, goal = (Foot(*row.tolist()) for row in (feet[last], wanted[k, last]))
            self.steps[last].append(Step(start, end, origin, goal))
            feet = feet.copy()
            feet[last] = wanted[k, last]
            time = start + float(fly[k] + rest[k])

    def _table(self, side: int) -> tuple[Array, Array, Array, Array]:
        """Start and end, origin and goal of every step of a foot; the first one has been done long ago."""
        steps, first = self.steps[side], self._first[side]
        return (
            np.array([-math.inf, *(step.start for step in steps)]),
            np.array([-1e9, *(step.end for step in steps)]),
            np.array([first, *(step.origin for step in steps)]),
            np.array([first, *(step.goal for step in steps)]),
        )

    def __call__(self, time: float) -> tuple[Foot, Foot]:
        """Left and right foot at a time [s]."""
        left, right = self.at(np.array([time]))[0].tolist()
        return Foot(*left), Foot(*right)

    def at(self, times: Array) -> Array:
        """Rows of `Foot`, left and right, at times (T,) [s]: (T, 2, 4)."""
        return np.stack([self._foot(rows, times) for rows in self._rows], axis=1)

    def _foot(self, rows: tuple[Array, Array, Array, Array], times: Array) -> Array:
        which = np.searchsorted(rows[0], times, side="right") - 1
        start, end, a, b = (row[which] for row in rows)
        flying = times < end
        share = np.divide(times - start, end - start, out=np.ones(len(times)), where=flying)
        moved = share**2 * (3.0 - 2.0 * share)
        size = np.minimum(_separation(a, b) / 0.5, 1.0)
        foot: Array = a + moved[:, None] * (b - a)
        foot[:, 2] = a[:, 2] + moved * remainder(b[:, 2] - a[:, 2])
        foot[:, 3] = self._lift * (0.4 + 0.6 * size) * np.sin(math.pi * share) ** 2
        foot[~flying] = b[~flying]
        return foot


def remainder(angle: Array) -> Array:
    """The same direction, from -pi to pi [rad]."""
    found: Array = angle - 2.0 * math.pi * np.rint(angle / (2.0 * math.pi))
    return found


def _separation(a: Array, b: Array) -> Array:
    """How far apart foot placements (..., 4) are [m]; a radian of turn counts as 0.25 m."""
    away = np.hypot(a[..., 0] - b[..., 0], a[..., 1] - b[..., 1])
    return np.asarray(np.hypot(away, 0.25 * remainder(a[..., 2] - b[..., 2])))
