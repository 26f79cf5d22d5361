"""Robots in different situations, stepped as a batch and one by one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import qpsafe

NOBODY = np.zeros((0, 3))


class Pairs:
    """A batch beside as many controllers, each robot following its references perfectly, compared at every tick.

    Args:
        make: Makes a controller.
        n: How many robots.
        within: How far references may be apart [rad]; 0 for the same bits.
        options: Of the batch.
    """

    def __init__(self, make: Callable[[], Any], n: int, within: float = 0.0, **options: Any) -> None:
        self.controllers = [make() for _ in range(n)]
        self.batch = qpsafe.BatchController(make(), n, **options)
        self.n, self.within, home = n, within, self.batch.robot.home
        self.q, self.qd = np.tile(home, (n, 1)), np.zeros((n, len(home)))
        self.own_q, self.own_qd = self.q.copy(), self.qd.copy()
        self.phases: Counter[str] = Counter()
        self.statuses: Counter[str] = Counter()
        self.events: list[tuple[int, str]] = []

    def step(self, seen: Callable[[int], dict[str, Any]], wrong: dict[int, Any] | None = None) -> Any:
        """One tick; `seen(i)` is what robot i is told beside its joints, `wrong` joints that are measured instead."""
        told = [seen(r) for r in range(self.n)]
        q, own_q = self.q.copy(), self.own_q.copy()
        for r, value in (wrong or {}).items():
            q[r] = own_q[r] = value
        if "points" in told[0]:
            tick = self.batch.step(own_q, self.own_qd, points=[one["points"] for one in told])
        else:
            ages = np.array([np.broadcast_to(one.get("ages", 0.0), one["distances"].shape) for one in told])
            tick = self.batch.step(own_q, self.own_qd, np.array([one["distances"] for one in told]), ages=ages)
        alone = [controller.step(q[r], self.qd[r], **told[r]) for r, controller in enumerate(self.controllers)]
        self._compare_numbers(alone, tick)
        for r, one in enumerate(alone):
            self._compare_words(r, one, tick)
        self.q, self.qd = (np.array([getattr(one.reference, key) for one in alone]) for key in ("q", "qd"))
        self.own_q, self.own_qd = tick.q, tick.qd
        return tick

    def _compare_numbers(self, alone: list[Any], tick: Any) -> None:
        rows = tick.errors.shape[1]
        errors = [np.concatenate(one.errors) if one.errors else np.full(rows, np.nan) for one in alone]
        numbers = (
            ([one.reference.q for one in alone], tick.q, self.within),
            ([one.reference.qd for one in alone], tick.qd, 100.0 * self.within),
            ([one.qd0 for one in alone], tick.qd0, 10.0 * self.within),
            ([(one.cdf_n, one.m, one.f) for one in alone], np.c_[tick.cdf_n, tick.m, tick.f], 100.0 * self.within),
            ([one.activations for one in alone], tick.activations, 100.0 * self.within),
            ([one.path_time for one in alone], tick.path_time, 0.0),
            (errors, tick.errors, 10.0 * self.within + 1e-13),  # the controller's own logarithm is another one
        )
        for mine, together, much in numbers:
            expected = np.array(mine)
            near = (np.abs(together - expected) <= much) | (np.isnan(together) & np.isnan(expected))
            assert near.all(), (together - expected, self.batch)
        expected = np.array([(one.reference.active, one.reference.seq) for one in alone])
        assert np.array_equal(np.c_[tick.active, tick.seq], expected)

    def _compare_words(self, r: int, one: Any, tick: Any) -> None:
        assert (tick.PHASES[tick.phase[r]], tick.STATUSES[tick.status[r]]) == (one.phase, one.status), one.messages
        assert tick.events.get(r, ()) == one.events
        waits = [task.name for k, task in enumerate(self.controllers[r].tasks) if tick.waits_for[r] >> k & 1]
        assert tuple(waits) == one.waits_for
        assert bool(tick.words(r)) == bool(one.messages)
        self.phases[one.phase] += 1
        self.statuses[one.status] += 1
        self.events += [(r, name) for name in one.events]


def comings(robot: Any, n: int, ticks: int, seed: int = 0) -> list[list[np.ndarray]]:
    """Points that each of n robots sees at each tick: one to three, coming, staying, going, at their own speeds."""
    rng = np.random.default_rng(seed)
    tip, found = robot.pose(robot.tool_frames[0], robot.home)[:3, 3], []
    for r in range(n):
        turn, near, speed = rng.uniform(-1.5, 1.5), rng.uniform(0.1, 0.45), rng.uniform(0.5, 2.5)
        way, stay = (1.0 - near) / speed, rng.uniform(0.05, 0.4)
        towards, spread = np.array((np.cos(turn), np.sin(turn), 0.2)), rng.uniform(-0.1, 0.1, (rng.integers(1, 4), 3))
        row = []
        for k in range(ticks):
            t = (0.004 * k - 0.2 * (r % 4)) % (2.0 * way + stay + 1.2)
            away = 1.0 - speed * t if t < way else near if t < way + stay else near + speed * (t - way - stay)
            row.append(tip + away * towards + spread if away < 1.0 else NOBODY)
        found.append(row)
    return found


@pytest.fixture(scope="session")
def pairs() -> Any:
    return Pairs


@pytest.fixture(scope="session")
def come() -> Any:
    return comings
