"""Robots with parts of any making: as many controllers, asked one after the other."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.batch import code
from qpsafe.batch.given import Given
from qpsafe.batch.result import BatchTick

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController

Index = NDArray[np.int64]


class GeneralRobots:
    """Robots of a batch.

    Args:
        controller: Whose parts they have.
        n: How many.
    """

    def __init__(self, controller: SafetyController, n: int) -> None:
        self._controllers = [copy(controller) for _ in range(n)]
        self._tasks = tuple(task.name for task in controller.tasks)
        state = controller.robot.at(controller.robot.home)
        self._rows = sum(len(task.jacobian(state)) for task in controller.tasks)

    def step(self, given: Given) -> BatchTick:
        """One tick of all robots."""
        ticks = []
        for r, controller in enumerate(self._controllers):
            seen: dict[str, Any] = {}
            if given.how == code.DISTANCES:
                seen = {"distances": given.distances[r], "ages": given.ages[r]}
            elif given.how == code.POINTS:
                seen = {"points": given.points[given.starts[r] : given.starts[r + 1]]}
            tick = controller.step(given.q[r], given.qd[r], **seen)
            if given.wrong:
                tick.messages = (given.wrong,)
            ticks.append(tick)
        return BatchTick.of(ticks, self._tasks, self._rows)

    def reset(self, which: Index) -> None:
        """See `BatchController.reset`."""
        for r in which:
            self._controllers[r].reset()

    def reseed(self, which: Index) -> None:
        """See `SafetyController.reseed`."""
        for r in which:
            self._controllers[r].reseed()

    def acknowledge(self, which: Index) -> None:
        """See `SafetyController.acknowledge`."""
        for r in which:
            self._controllers[r].acknowledge()

    def pause(self, which: Index, paused: bool) -> None:
        """See `SafetyController.pause`."""
        for r in which:
            self._controllers[r].pause() if paused else self._controllers[r].resume()
