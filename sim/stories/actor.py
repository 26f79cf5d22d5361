"""One person of a story: poses at any time, of the steps as planned."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.footsteps import Footsteps
from qpsafe.sim.people.person import Foot, PersonPose, PersonPoses
from qpsafe.sim.people.posture import Postures
from qpsafe.sim.people.walker import Root, Roots
from qpsafe.sim.stories.changes import local_rows
from qpsafe.sim.stories.planning import Plan, Taken

Array = NDArray[np.float64]

WALK_RATIO = 0.0065  # step length [m] over cadence [steps/min], the same at all usual speeds: Sekiya et al. 1996
HURRY, STRIDE = 2.01, (1.3, 1.1)  # steps are no longer than so many legs, up to a speed [m/s] and above
STEP = 0.55, 0.40  # longest and shortest time of a step; Footsteps' own is the longest [s]


class Actor(Plan):
    """One person of a story; see `Plan` for what is planned."""

    def root(self, time: float) -> Root:
        """x, y [m] and heading [rad] at a time [s]."""
        x, y, heading = (float(value) for value in self.course(time))
        return x, y, heading

    def pose(self, time: float) -> PersonPose:
        """The whole person at a time [s]."""
        return self.poses_at(np.array([time]))[0]

    def poses_at(self, times: Array) -> PersonPoses:
        """The whole person at times (T,) [s]."""
        roots = self.course(times)
        return self.person.poses(np.stack(roots, axis=-1), self._footsteps.at(times), self.postures(times, roots))

    def footprints(self, until: float) -> tuple[list[Foot], list[Foot]]:
        """Where left and right foot stand, one after another, until a time [s]."""
        first = self._footsteps(0.0)
        left, right = ([s.goal for s in steps if s.start < until] for steps in self._footsteps.steps)
        return [first[0], *left], [first[1], *right]

    def reached(self, step: Taken) -> list[Array]:
        """Where the hands of a reaching step are at its end (3,) [m], those that hang left out."""
        hands = self.pose(step.end).hands
        at_point = [changes(np.array([step.end]))[0, :2].sum() == 0.0 for changes in self._arms]
        return [hand for there, hand in zip(at_point, hands, strict=True) if there]

    def postures(self, times: Array, roots: Roots) -> Postures:
        """What arms, back and head do at times (T,) [s].

        Args:
            times: (T,) [s].
            roots: Where the root is then.
        """
        arms = [local_rows(changes(times), roots, self.person.floor) for changes in self._arms]
        resting = None
        if self._rests:
            nowhere = (math.nan,) * 4
            places = np.array([nowhere, *(nowhere if place is None else place for _, place in self._rests)])
            resting = places[np.searchsorted([at for at, _ in self._rests], times, side="right")]
        return Postures(np.stack(arms, axis=1), self._stoops(times), self._gaze(times), self._hold(times), resting)

    @cached_property
    def _footsteps(self) -> Footsteps:
        leg = self.person.body.thigh + self.person.body.shank

        def pace(times: Array) -> tuple[Array, Array]:
            """Time in the air and time with both feet down; the faster, the less of the latter."""
            speeds = self.course.speed(times + np.array([[0.4], [0.0], [0.2], [0.7], [1.0]]))
            speed, fastest = speeds[0], speeds.max(axis=0)
            longest = np.where(fastest > HURRY, STRIDE[1], STRIDE[0]) * leg / np.maximum(fastest, 0.1)
            cadence = np.sqrt(60.0 * np.maximum(speed, 0.1) / (WALK_RATIO * self.person.body.scale))
            step = np.minimum(np.clip(60.0 / cadence, STEP[1], STEP[0]), longest)
            both = np.clip(0.30 - 0.10 * speed, 0.08, 0.20) * step
            return step - both, both

        return Footsteps(self.person, self.course, self.end + 2.0, lift=0.055 * self.person.body.scale, pace=pace)
