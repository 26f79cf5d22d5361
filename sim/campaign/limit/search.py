"""The search for the best motion: goals at random, CMA-ES from the best of them, then a second goal after the first."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.campaign.worst.strategy import strategy

if TYPE_CHECKING:
    from qpsafe.sim.campaign.limit.escape import Escape

Array = NDArray[np.float64]

EVALUATIONS = 800  # motions that are tried
CLIMBS = 3  # from the best goals; a last one begins with the best of all and has a second goal
SECOND = 0.8  # when the second goal begins [s]
STEP, LAST_STEP = 0.2, 0.1  # first standard deviations of the climbs, of a joint's range or of 2 rad
WIDE = 2.0  # [rad]
HOPELESS = 0.1  # so much worse than the best of a climb need not be known exactly [m]
NEAR = 1e-4  # this near to what no motion can exceed there is nothing left to search [m]


class Way(NamedTuple):
    """Goals and what they are worth.

    Attributes:
        value: See `Escape.compared` [m].
        goals: (g, n) [rad].
        since: Ticks after the first command (g,).
    """

    value: float
    goals: Array
    since: NDArray[np.int64]


def best_way(escape: Escape, tried: Sequence[Array], seed: int, evaluations: int = EVALUATIONS) -> tuple[Way, int]:
    """The best goals that were found, and how many motions were tried.

    Args:
        escape: The state, and who comes.
        tried: Joint positions to begin with, beside random ones, each (n,) [rad].
        seed: Of everything random.
        evaluations: Motions to try.

    Raises:
        MissingExtraError: cma is not installed.
    """
    return _Search(escape, seed, evaluations).found(tried)


class _Search:
    def __init__(self, escape: Escape, seed: int, evaluations: int) -> None:
        self._escape, self._left, self._whole = escape, evaluations, evaluations
        self._rng = np.random.default_rng((seed, 0x11517))
        robot = escape.robot
        # joints without end go round once
        self._lower, self._upper = np.maximum(robot.lower, -np.pi * 2), np.minimum(robot.upper, np.pi * 2)
        self._scale = np.minimum(0.5 * (self._upper - self._lower), WIDE)
        self.best = Way(-inf, np.empty((0, robot.nq)), np.zeros(0, dtype=np.int64))

    @property
    def _over(self) -> bool:
        return self._left <= 0 or self.best.value >= self._escape.fixed - NEAR

    def found(self, tried: Sequence[Array]) -> tuple[Way, int]:
        once, twice = np.zeros(1, dtype=np.int64), np.array((0, round(SECOND / DT)), dtype=np.int64)
        ways = self._screened(tried, once)
        each = self._left // (CLIMBS + 1)
        for way in ways[:CLIMBS]:
            self._climb(way.goals, once, STEP, each)
        if not self._over:
            self._climb(np.tile(self.best.goals, (2, 1)), twice, LAST_STEP, self._left)
        return self.best, self._whole - self._left

    def _screened(self, tried: Sequence[Array], since: NDArray[np.int64]) -> list[Way]:
        """Single goals, the best first."""
        random = self._rng.uniform(self._lower, self._upper, (max(self._whole // 4 - len(tried), 0), len(self._lower)))
        ways: list[Way] = []
        for goal in (*tried, *random):
            if self._over:
                break
            enough = ways[CLIMBS - 1].value if len(ways) >= CLIMBS else -inf
            ways.append(self._tried(goal[None], since, enough))
            ways.sort(key=lambda way: -way.value)
        return ways

    def _climb(self, goals: Array, since: NDArray[np.int64], step: float, budget: int) -> None:
        """CMA-ES from some goals."""
        scale, end = self._scale, self._left - budget
        climb = strategy((goals / scale).ravel(), step, self._rng, tolfun=1e-4, tolx=1e-4)
        top = -inf
        while self._left - climb.popsize >= end and not self._over and not climb.stop():
            asked = climb.ask()
            values = []
            for x in asked:
                way = self._tried(np.reshape(x, goals.shape) * scale, since, top - HOPELESS)
                values.append(-way.value)
                top = max(top, way.value)
            climb.tell(asked, values)

    def _tried(self, goals: Array, since: NDArray[np.int64], enough: float) -> Way:
        goals = np.ascontiguousarray(np.clip(goals, self._lower, self._upper))
        self._left -= 1
        way = Way(self._escape.compared(goals, since, enough), goals, since)
        if way.value > self.best.value:
            self.best = way
        return way
