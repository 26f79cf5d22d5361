"""Many robots with the parts of one `SafetyController`, stepped in one call over all cores."""

from __future__ import annotations

import os
import time
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.batch.compiled_robots import CompiledRobots
from qpsafe.batch.general_robots import GeneralRobots
from qpsafe.batch.given import take
from qpsafe.batch.knots import Refused
from qpsafe.batch.pack import HORIZON
from qpsafe.batch.result import BatchTick
from qpsafe.controller import SafetyController
from qpsafe.errors import ConfigurationError
from qpsafe.text.given import number, whole
from qpsafe.text.words import call

#: More robots, or a horizon of more ticks, fit into no memory.
MOST_ROBOTS, MOST_TICKS = 1_000_000, 10_000_000


class BatchController:
    """n independent robots with the parts of one controller; what one does, or is told, never affects another.

    Each robot's whole tick is compiled if the parts are plain: tasks on rows of a frame's pose, a built-in law with the
    built-in solver, the built-in field, evasion, limits, activation and recovery rules, no barrier, no separation. The
    references are then those of as many `SafetyController`s: the same bits where trajectories are `FixedPose`s, else
    from knots that were checked against the trajectory (1e-10 m or rad). Other parts work the general way, by copies of
    the controller, more slowly; `why` says which part it is.

    Args:
        controller: Its parts are used as they are now, its state is not: all robots start afresh.
        n: How many robots.
        threads: How many threads share them; by default one per core. Results do not depend on it.
        horizon: How far ahead a trajectory without an end is sampled; farther when a clock gets there [s].

    Raises:
        ConfigurationError: An argument is not one of these.
    """

    def __init__(
        self, controller: SafetyController, n: int, threads: int | None = None, horizon: float = HORIZON
    ) -> None:
        if not isinstance(controller, SafetyController):
            raise ConfigurationError("BatchController", "controller", controller, "a SafetyController")
        if controller.ranging is not None:  # its robots would go on without what they see by
            expected = "none: a batch takes no images; give distances or points"
            raise ConfigurationError("BatchController", "range_sensors", controller.ranging.sensors, expected)
        n = whole("BatchController", "n", n, f"a whole number from 1 to {MOST_ROBOTS}", 1, MOST_ROBOTS)
        threads = _cores() if threads is None else threads
        threads = whole("BatchController", "threads", threads, "a whole number >= 1", 1)
        longest = controller.dt * MOST_TICKS
        expected = f"a time from one tick to {longest:g} s"
        horizon = number("BatchController", "horizon", horizon, expected, controller.dt, most=longest)
        self._controller = copy(controller)
        self._controller.reset()
        self._n = n
        self._spots = 0 if controller.spots is None else len(controller.spots)
        #: Why the ticks are not compiled, in words; empty if they are.
        self.why = ""
        try:
            self._robots: CompiledRobots | GeneralRobots = CompiledRobots(
                self._controller, self._n, threads, horizon
            )  # fmt: skip
        except Refused as reason:
            self.why, self._robots = str(reason), GeneralRobots(self._controller, self._n)

    def __repr__(self) -> str:
        return call(self, self._controller, self._n, compiled=self.compiled)

    @property
    def n(self) -> int:
        """How many robots."""
        return self._n

    @property
    def robot(self) -> Any:
        """The robot that they are."""
        return self._controller.robot

    @property
    def dt(self) -> float:
        """Tick [s]."""
        return self._controller.dt

    @property
    def compiled(self) -> bool:
        """Whether the whole tick is compiled; else `why` says why not."""
        return not self.why

    def step(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        distances: ArrayLike | None = None,
        *,
        points: Any = None,
        ages: ArrayLike | None = None,
    ) -> BatchTick:
        """One tick of all robots. Never raises on data: a robot whose data cannot be used brakes and holds.

        Args:
            q: Measured joint positions (n, joints) [rad].
            qd: Measured joint velocities (n, joints) [rad/s].
            distances: Readings of each robot's k spots (n, k) [m], as for `SafetyController.step`.
            points: Detected points instead, world frame [m]: a list of n arrays (p_i, 3), or an array (n, p, 3) in
                which rows of NaN are no points.
            ages: How old the distances are, one number or what becomes (n, k) [s]; fresh by default.
        """
        start = time.perf_counter()
        given = take((self._n, self.robot.nq), self._spots, q, qd, distances, points, ages)
        tick = self._robots.step(given)
        tick.solve_time = time.perf_counter() - start
        return tick

    def reset(self, mask: ArrayLike | None = None) -> None:
        """Start robots anew, see `SafetyController.reset`.

        Args:
            mask: Which ones (n,) of truth values, or their numbers; all by default.
        """
        self._robots.reset(self._which(mask))

    def reseed(self, mask: ArrayLike | None = None) -> None:
        """Something else has moved or stopped robots, see `SafetyController.reseed`; `mask` as for `reset`."""
        self._robots.reseed(self._which(mask))

    def acknowledge(self, mask: ArrayLike | None = None) -> None:
        """A person has seen to the sensors, see `SafetyController.acknowledge`; `mask` as for `reset`."""
        self._robots.acknowledge(self._which(mask))

    def pause(self, mask: ArrayLike | None = None) -> None:
        """Bring the clocks of paths to rest, see `SafetyController.pause`; `mask` as for `reset`."""
        self._robots.pause(self._which(mask), True)

    def resume(self, mask: ArrayLike | None = None) -> None:
        """Let the clocks of paths run again; `mask` as for `reset`."""
        self._robots.pause(self._which(mask), False)

    def _which(self, mask: ArrayLike | None) -> NDArray[np.int64]:
        every = np.arange(self._n)
        if mask is None:
            return every
        chosen = np.asarray(mask)
        numbers = chosen.dtype.kind in "iu" and chosen.ndim == 1
        if not (numbers or (chosen.dtype == np.bool_ and chosen.shape == every.shape)):
            raise ConfigurationError("BatchController", "mask", mask, f"{self._n} truth values, or numbers of robots")
        if numbers and not ((chosen >= 0) & (chosen < self._n)).all():
            raise ConfigurationError("BatchController", "mask", mask, f"numbers of robots, 0 to {self._n - 1}")
        return every[chosen]


def _cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
