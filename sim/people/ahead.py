"""Poses tick after tick: made for a second at a time, which takes little more time than a single one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.poses import PersonPose, PersonPoses

BLOCK = 250  # ticks


class Mover(Protocol):
    """Somebody who moves whatever happens: an `Actor`, or the person of a `Choreography`."""

    def poses_at(self, times: NDArray[np.float64]) -> PersonPoses:
        """Poses at times (T,) [s]."""


class PosesAhead:
    """Everybody's poses at a tick.

    Args:
        people: Who.
        dt: Tick [s].
    """

    def __init__(self, people: Sequence[Mover], dt: float) -> None:
        self._people, self._dt = people, dt
        self._block, self._poses = -1, [PersonPoses(np.empty((0, 17, 2, 3)), np.empty(0))]

    def __call__(self, tick: int) -> tuple[PersonPose, ...]:
        """Everybody at a tick, 0 or more."""
        block, k = divmod(tick, BLOCK)
        if block != self._block:
            times = np.arange(block * BLOCK, (block + 1) * BLOCK, dtype=float) * self._dt
            self._block, self._poses = block, [person.poses_at(times) for person in self._people]
        return tuple(poses[k] for poses in self._poses)
