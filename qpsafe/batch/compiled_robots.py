"""Robots whose ticks are compiled: their blocks, and the threads that share them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.batch import code
from qpsafe.batch.given import Given
from qpsafe.batch.knots import Refused
from qpsafe.batch.pack import new_state, new_work, own_of, pack, put, reset
from qpsafe.batch.result import BatchTick
from qpsafe.batch.words import words_of
from qpsafe.recovery.steps import FOLLOWING
from qpsafe.sensing.health import HEALTHY

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController

Index = NDArray[np.int64]

_FEWEST = 8  # robots that are worth a thread


class CompiledRobots:
    """Robots of a batch.

    Args:
        controller: Whose parts they have.
        n: How many.
        threads: How many threads share them.
        horizon: How far a trajectory is looked at that tells no end [s].

    Raises:
        Refused: A part is not plain.
    """

    def __init__(self, controller: SafetyController, n: int, threads: int, horizon: float) -> None:
        self._controller, self._n, self._threads, self._horizon = controller, n, threads, float(horizon)
        self._packed = pack(controller, self._horizon)
        self._ends = bool((self._packed.shared.kinds == code.ENDS).any())
        import qpsafe.batch.rows_kernel  # noqa: F401  compile it now if need be, not within the first tick

        self._state = new_state(self._packed, n)
        self._work: list[tuple[NDArray[np.float64], Index]] = []
        self._pool: ThreadPoolExecutor | None = None

    def __getstate__(self) -> dict[str, Any]:
        """A copy makes threads of its own."""
        return {**self.__dict__, "_pool": None, "_work": []}

    def step(self, given: Given) -> BatchTick:
        """One tick of all robots."""
        self._run(given)
        tick = self._told(given.wrong)
        if self._ends and tick.path_time.max() + 2.0 * self._controller.dt > self._horizon:
            self._look_farther()
        return tick

    def _look_farther(self) -> None:
        """Look twice as far at trajectories that tell no end; where that cannot be, robots will brake there."""
        self._horizon *= 2.0
        try:
            self._packed = pack(self._controller, self._horizon)
        except Refused:
            self._ends = False

    def _run(self, given: Given) -> None:
        """The ticks, shared out among the threads."""
        from qpsafe.batch.rows_kernel import step_rows

        count = max(min(self._threads, self._n // _FEWEST), 1)
        if len(self._work) < count or self._work[0][1][0] < given.most:
            self._work = [new_work(self._packed, 2 * given.most) for _ in range(count)]
        edges = np.linspace(0, self._n, count + 1).astype(int)
        calls = [
            (*self._packed.blocks, *self._state, *self._work[k], *given[:7], edges[k], edges[k + 1])
            for k in range(count)
        ]
        if count > 1 and self._pool is None:
            self._pool = ThreadPoolExecutor(count - 1, thread_name_prefix="qpsafe-batch")
        others = [self._pool.submit(step_rows, *arguments) for arguments in calls[1:]] if self._pool else []
        step_rows(*calls[0])
        for other in others:
            other.result()

    def _told(self, wrong: str) -> BatchTick:
        """The tick from the robots' blocks."""
        (floats, integers, spots), at = self._state, self._packed.own
        marks = integers[:, at.marks]
        happened = integers[:, at.happened[:, 1].ravel()]
        odd = np.flatnonzero(marks[:, code.STATUS])
        kept = floats[odd], integers[odd], spots[odd]  # as they are now, for later questions
        names = () if self._controller.spots is None else self._controller.spots.names

        def words(robot: int) -> tuple[str, ...]:
            (place,) = np.flatnonzero(odd == robot) if robot in odd else (-1,)
            if place < 0 or wrong:
                return (wrong,) if wrong else ()
            return words_of(own_of(self._packed, kept[0][place], kept[1][place]), kept[2][place, 0], names)

        return BatchTick(
            q=floats[:, at.q],
            qd=floats[:, at.qd],
            active=marks[:, code.ACTIVE] == 1,
            seq=marks[:, code.SEQ].copy(),
            cdf_n=floats[:, at.result[code.CDF_N]].copy(),
            m=floats[:, at.result[code.M]].copy(),
            f=floats[:, at.result[code.F]].copy(),
            activations=floats[:, at.activations],
            qd0=floats[:, at.qd0],
            phase=marks[:, code.PHASE].copy(),
            status=marks[:, code.STATUS].copy(),
            path_time=floats[:, at.clock[code.TIME]].copy(),
            waits_for=marks[:, code.WAITS].copy(),
            errors=floats[:, at.errors],
            events={int(r): self._events(int(r)) for r in np.flatnonzero(happened.any(axis=1))},
            words=words,
        )

    def _events(self, robot: int) -> tuple[str, ...]:
        """Names of the events of a robot's last tick, in their order."""
        shared, own = self._packed.shared, own_of(self._packed, *(block[robot] for block in self._state[:2]))
        found = []
        for path, (first, count) in enumerate(own.happened):
            begin, names = shared.first_event[path], self._packed.events[path]
            for k in range(first, first + count):
                cycles, place = divmod(k, len(names))
                found.append((shared.event_times[begin + place] + cycles * shared.periods[path], names[place]))
        return tuple(name for _, name in sorted(found, key=lambda event: event[0]))

    def reset(self, which: Index) -> None:
        """See `BatchController.reset`."""
        reset(self._packed, self._state, which)

    def reseed(self, which: Index) -> None:
        """See `SafetyController.reseed`."""
        (floats, integers, _), own = self._state, self._packed.own
        for places in (own.evasive, own.qd, own.before):
            put(floats, which, places, 0.0)
        for mark, value in ((code.ACTIVE, 0), (code.WAY, 0), (code.CHANGED, 1)):
            integers[which, own.marks[mark]] = value
        away = integers[which, own.marks[code.PHASE]] != FOLLOWING
        for task in own.tasks:
            integers[which, task[code.PENDING]] = away
            integers[np.ix_(which, task[[code.RETURNING, code.KNOWN]])] = 0

    def acknowledge(self, which: Index) -> None:
        """See `SafetyController.acknowledge`."""
        (_, integers, spots), own, sensing = self._state, self._packed.own, self._controller.sensing
        if sensing is not None:
            counts = integers[np.ix_(which, own.counts.ravel())].reshape(len(which), -1, 3)
            dead = counts[:, :, 1] >= sensing.health.ticks[1]
            dying, out = dead.sum(axis=1), (dead | (counts[:, :, 0] != HEALTHY)).sum(axis=1)
            spots[which, 0] = dead
            marks = {code.DYING: dying, code.STOPPED: dying > sensing.health.most, code.OUT: out}
            for mark, value in marks.items():
                integers[which, own.marks[mark]] = value
        spots[which, 1] = False
        put(integers, which, own.far, 0)
        for mark in (code.UNIT_TICKS, code.FAR_POINTS, code.ODD):
            integers[which, own.marks[mark]] = 0

    def pause(self, which: Index, paused: bool) -> None:
        """See `SafetyController.pause`."""
        self._state.integers[which, self._packed.own.marks[code.PAUSED]] = paused
