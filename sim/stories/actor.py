"""One person of a story: poses at any time, of the steps as planned."""

from __future__ import annotations

import bisect
import math
from functools import cached_property

from numpy import float64
from numpy.typing import NDArray

from qpsafe.sim.people.footsteps import Footsteps
from qpsafe.sim.people.person import Foot, PersonPose
from qpsafe.sim.people.posture import Arm, Posture, Stoop
from qpsafe.sim.people.walker import Root, eased
from qpsafe.sim.stories.planning import Plan, Taken
from qpsafe.sim.stories.timeline import Change

WALK_RATIO = 0.0065  # step length [m] over cadence [steps/min], the same at all usual speeds: Sekiya et al. 1996
STEP = 0.55, 0.40  # longest and shortest time of a step; Footsteps' own is the longest [s]


class Actor(Plan):
    """One person of a story; see `Plan` for what is planned."""

    def root(self, time: float) -> Root:
        """x, y [m] and heading [rad] at a time [s]."""
        return self.course(time)

    def pose(self, time: float) -> PersonPose:
        """The whole person at a time [s]."""
        return self.person.pose(*self.course(time), self._footsteps(time), self.posture(time))

    def footprints(self, until: float) -> tuple[list[Foot], list[Foot]]:
        """Where left and right foot stand, one after another, until a time [s]."""
        first = self._footsteps(0.0)
        left, right = ([s.goal for s in steps if s.start < until] for steps in self._footsteps.steps)
        return [first[0], *left], [first[1], *right]

    def reached(self, step: Taken) -> list[NDArray[float64]]:
        """Where the hands of a reaching step are at its end (3,) [m], those that hang left out."""
        posture, hands = self.posture(step.end), self.pose(step.end).hands
        return [hand for arm, hand in zip(posture.arms, hands, strict=True) if not isinstance(arm.goal, str)]

    def posture(self, time: float) -> Posture:
        """What arms, back and head do at a time [s]."""
        arms = [Arm(self._first, self._first)] * 2
        for i, changes in enumerate(self._arms):
            change = _latest(changes, time)
            if change is not None:
                arms[i] = Arm(change.a, change.b, _share(change, time), change.lift)
        resting = None
        for at, place in self._rests:
            if at <= time:
                resting = place
        hold = self._blend(self._hold, time, self._nominal if not self._rests or self._hold else self._at)
        stoop = Stoop(*self._blend(self._stoops, time, Stoop()))
        return Posture((arms[0], arms[1]), stoop, hold, resting, self._blend(self._gaze, time, (0.0, 0.0)))

    def _blend(self, changes: list[Change], time: float, otherwise: tuple[float, float]) -> tuple[float, float]:
        change = _latest(changes, time)
        if change is None:
            return changes[0].a if changes else otherwise
        s = _share(change, time)
        return (1.0 - s) * change.a[0] + s * change.b[0], (1.0 - s) * change.a[1] + s * change.b[1]

    @cached_property
    def _footsteps(self) -> Footsteps:
        def pace(time: float) -> tuple[float, float]:
            """Time in the air and time with both feet down; the faster, the less of the latter."""
            speed = self.course.speed(time + 0.4)
            cadence = math.sqrt(60.0 * max(speed, 0.1) / (WALK_RATIO * self.person.body.scale))
            step = min(max(60.0 / cadence, STEP[1]), STEP[0])
            both = min(max(0.30 - 0.10 * speed, 0.08), 0.20) * step
            return step - both, both

        return Footsteps(self.person, self.course, self.end + 2.0, lift=0.055 * self.person.body.scale, pace=pace)


def _latest(changes: list[Change], time: float) -> Change | None:
    index = bisect.bisect_right(changes, time, key=lambda change: change.start) - 1
    return None if index < 0 else changes[index]


def _share(change: Change, time: float) -> float:
    return eased((time - change.start) / (change.end - change.start))
