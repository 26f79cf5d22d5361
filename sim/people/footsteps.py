"""Footsteps for a given walk: feet that stand still on the floor until they step.

The walk (position and heading as functions of time) is known beforehand, so the steps are planned once: whenever both
feet stand, the one that will be farthest from where it should be half a stance later swings there. Walking forwards,
backwards, sideways and turning on the spot all come out of this one rule.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from qpsafe.sim.people.person import Foot, Person

Walk = Callable[[float], tuple[float, float, float]]


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
        pace: Callable[[float], tuple[float, float]] | None = None,
    ) -> None:
        """Plan the steps.

        Args:
            person: Whose feet.
            walk: t [s] -> x [m], y [m], heading [rad].
            duration: Of the walk [s].
            swing: Time a foot is in the air [s].
            stand: Time both feet stand between two steps [s].
            lift: Height of a full step [m].
            pace: t [s] -> `swing` and `stand` then, for people who walk at many speeds.
        """
        self._lift = lift
        self._first = person.standing_feet(*walk(0.0))
        self.steps: tuple[list[Step], list[Step]] = ([], [])
        feet = list(self._first)
        last, time = 1, 0.0
        while time < duration:
            fly, rest = (swing, stand) if pace is None else pace(time)
            ahead = fly + fly / 2 + rest  # middle of the stance that follows a swing which starts now
            wanted = person.standing_feet(*walk(min(time + ahead, duration)))
            errors = [_separation(foot, goal) for foot, goal in zip(feet, wanted, strict=True)]
            side = int(errors[1] > errors[0]) if abs(errors[0] - errors[1]) > 0.05 else 1 - last
            if errors[side] < 0.035:
                time += 0.02
                continue
            self.steps[side].append(Step(time, time + fly, feet[side], wanted[side]))
            feet[side] = wanted[side]
            last = side
            time += fly + rest
        self._starts = tuple([step.start for step in steps] for steps in self.steps)

    def __call__(self, time: float) -> tuple[Foot, Foot]:
        """Left and right foot at a time [s]."""
        return self._foot(0, time), self._foot(1, time)

    def _foot(self, side: int, time: float) -> Foot:
        index = bisect.bisect_right(self._starts[side], time) - 1
        if index < 0:
            return self._first[side]
        step = self.steps[side][index]
        if time >= step.end:
            return step.goal
        share = (time - step.start) / (step.end - step.start)
        moved = share**2 * (3.0 - 2.0 * share)
        a, b = step.origin, step.goal
        turn = math.remainder(b.yaw - a.yaw, 2.0 * math.pi)
        size = min(_separation(a, b) / 0.5, 1.0)
        lift = self._lift * (0.4 + 0.6 * size) * math.sin(math.pi * share) ** 2
        return Foot(a.x + moved * (b.x - a.x), a.y + moved * (b.y - a.y), a.yaw + moved * turn, lift)


def _separation(a: Foot, b: Foot) -> float:
    """How far apart two foot placements are [m]; a radian of turn counts as 0.25 m."""
    return float(np.hypot(np.hypot(a.x - b.x, a.y - b.y), 0.25 * math.remainder(a.yaw - b.yaw, 2.0 * math.pi)))
