"""What a tick of many robots came to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from qpsafe.recovery import steps
from qpsafe.text.words import counted
from qpsafe.tick import BAD_INPUT, DEGRADED, FAULT, OK, Tick

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Names:
    """What the numbers in a `BatchTick` stand for."""

    __slots__ = ()
    PHASES = steps.PHASES
    STATUSES = (OK, DEGRADED, BAD_INPUT, FAULT)


@dataclass(slots=True, eq=False, repr=False)
class BatchTick(Names):
    """Result of `BatchController.step`, one row per robot; its arrays are the caller's own.

    Attributes:
        q: Position references (n, joints) [rad].
        qd: Velocity references (n, joints) [rad/s].
        active: False until a robot's first valid measurement: do not move it on such a reference (n,).
        seq: Number of each robot's tick, from 0 (n,).
        cdf_n: Largest danger of each; NaN if it could not be told (n,).
        m: Switch (19) (n,).
        f: Switch (21) (n,).
        activations: Of the tasks (n, tasks).
        qd0: Evasive velocities (n, joints) [rad/s].
        phase: Numbers into `BatchTick.PHASES` (n,).
        status: Numbers into `BatchTick.STATUSES` (n,).
        path_time: Clocks of the tasks' trajectories (n,) [s].
        waits_for: The tasks that each path waits for, one bit per task, the first task's is 1 (n,).
        errors: Errors of the commanded pose against the tasks' own trajectories, all rows in the tasks' order, NaN
            where a robot brakes (n, rows) [m or rad].
        events: Names of the events that robots reached at this tick, by the robot's number.
        solve_time: Wall time of the whole call [s].
        words: `words(i)`: what is unusual about robot i's tick, a tuple of sentences.
    """

    q: Array
    qd: Array
    active: NDArray[np.bool_]
    seq: Index
    cdf_n: Array
    m: Array
    f: Array
    activations: Array
    qd0: Array
    phase: Index
    status: Index
    path_time: Array
    waits_for: Index
    errors: Array
    events: dict[int, tuple[str, ...]] = field(default_factory=dict)
    solve_time: float = 0.0
    words: Callable[[int], tuple[str, ...]] = lambda robot: ()

    def __repr__(self) -> str:
        count = {name: int((self.status == k).sum()) for k, name in enumerate(self.STATUSES)}
        told = ", ".join(f"{number} {name}" for name, number in count.items() if number)
        robots, danger = counted(len(self.q), "robot"), np.nanmax(self.cdf_n, initial=0.0)
        return f"BatchTick({robots}: {told}, largest danger {danger:.4g})"

    @classmethod
    def of(cls, ticks: list[Tick], tasks: tuple[str, ...], rows: int) -> BatchTick:
        """The same from ticks of single robots.

        Args:
            ticks: One a robot.
            tasks: Names of the tasks, as `Tick.waits_for` has them.
            rows: Of all tasks.
        """
        none = np.full(rows, np.nan)
        errors = [np.concatenate(tick.errors) if tick.errors else none for tick in ticks]
        return cls(
            q=np.array([tick.reference.q for tick in ticks]),
            qd=np.array([tick.reference.qd for tick in ticks]),
            active=np.array([tick.reference.active for tick in ticks]),
            seq=np.array([tick.reference.seq for tick in ticks]),
            cdf_n=np.array([tick.cdf_n for tick in ticks]),
            m=np.array([tick.m for tick in ticks]),
            f=np.array([tick.f for tick in ticks]),
            activations=np.array([tick.activations for tick in ticks]),
            qd0=np.array([tick.qd0 for tick in ticks]),
            phase=np.array([cls.PHASES.index(tick.phase) for tick in ticks]),
            status=np.array([cls.STATUSES.index(tick.status) for tick in ticks]),
            path_time=np.array([tick.path_time for tick in ticks]),
            waits_for=np.array([sum(1 << k for k, t in enumerate(tasks) if t in tick.waits_for) for tick in ticks]),
            errors=np.array([error if error.shape == none.shape else none for error in errors]),
            events={r: tick.events for r, tick in enumerate(ticks) if tick.events},
            words=lambda robot: ticks[robot].messages,
        )
