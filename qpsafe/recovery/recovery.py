"""Suspension and recovery of the tasks' path, section IV-C of the paper, as one small state machine.

following ──danger above Δ(1-ε)──> suspended ──danger small for a while──> recovering ──back at x_d,s──> following
                                        ^────────danger above────────┘
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.recovery import steps
from qpsafe.recovery.events import Cursor
from qpsafe.recovery.returns import RecoveryRules, Return
from qpsafe.recovery.steps import FINITE, HOLD, MET, PHASES, SET_OUT, quiet_after
from qpsafe.tasks.joint import JointTask
from qpsafe.tasks.trajectory import FixedJoints

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState
    from qpsafe.tasks.task import Task

__all__ = ["FOLLOWING", "RECOVERING", "SUSPENDED", "Recovery", "RecoveryRules"]

FOLLOWING, SUSPENDED, RECOVERING = PHASES
_Of = tuple["Recovery", "RobotState", tuple[float, ...]]


def _answer(question: int, of: _Of, time: float) -> bool:
    """Answer what the steps ask, see `qpsafe.recovery.steps`, of a recovery, its state and its activations."""
    own, state, activations = of
    if question == steps.DUE:
        return any([cursor.due(time) for cursor in own._cursors])  # noqa: C419  a generator takes longer to make
    if question == MET:
        return not own._not_met(state, (1.0,) * len(own.tasks))
    if question == FINITE:
        for task in own.tasks:
            if not task.trajectory.sample(own.path_time).finite:  # stay suspended, try again at the next tick
                raise ValueError(f"the trajectory of the {task.name} task is not finite")
        return True
    own.waits_for = own._not_back(activations) or own._not_met(state, activations)
    return not own.waits_for


def _too_fast(of: tuple[RecoveryRules, NDArray[np.float64], bool, Sequence[int]]) -> bool:
    return of[0].too_fast(*of[1:])


_next_phase, _advance = steps.phases_by(_answer)
_way_on = steps.ways_by(_too_fast)


class Recovery:
    """Clock of the tasks' path, and the references that lead back to it.

    While suspended the clock stands still, and tasks are held. When danger is past, every task returns smoothly from
    where it is then, x_d,r, to x_d,s. A task that is still released (a_k < 1) is not pulled: it is held where it is,
    its motion running out, and its return begins when it is fully active again and slow enough, be it after the path
    has gone on. The path goes on when every fully active task has returned; its clock comes to speed within `ramp`.

    Args:
        tasks: The controller's tasks, highest priority first.
        suspend_above: Δ(1-ε), the danger beyond which the path is suspended.
        dt: Tick [s].
        rules: How to return.
    """

    def __init__(
        self, tasks: Sequence[Task], suspend_above: float, dt: float, rules: RecoveryRules | None = None
    ) -> None:
        self._dt, self._rules = dt, RecoveryRules() if rules is None else rules
        self._enter(steps.FOLLOWING)
        self._step = dt / self.rules.ramp  # of the clock's rate, from tick to tick
        self._kept = math.exp(-dt / self.rules.fade)
        self.path_time, self.paused = 0.0, False
        #: Names of the tasks that the path waits for: not back yet, or not met when an event is due.
        self.waits_for: tuple[str, ...] = ()
        self._rate, self._quiet = 1.0, 0.0  # of the clock; for how long danger has been small [s]
        self._changed = self._led = False
        self._way: Recovery | None = None
        self._cursors: list[Cursor] = []
        self._passed: set[tuple[float, str]] = set()  # events at the very time where the clock stands
        self._due: tuple[list[tuple[Cursor, int]], set[tuple[float, str]]] | None = None  # found, not passed yet
        self.set_tasks(tasks, suspend_above, restart=True)
        self._changed = False

    def set_tasks(self, tasks: Sequence[Task], suspend_above: float, restart: bool) -> None:
        """Take other tasks from the next tick on; where they are not met, the robot returns to them smoothly.

        Args:
            tasks: Highest priority first.
            suspend_above: As for the class.
            restart: Whether the clock, and the events with it, starts from zero.
        """
        time, passed = (0.0, set()) if restart else (self.path_time, self._passed)
        kept = {} if restart else {id(cursor.trajectory): cursor for cursor in self._cursors}
        trajectories = {id(task.trajectory): task.trajectory for task in tasks}
        cursors = [  # may fail, and nothing has changed then
            kept.get(key) or Cursor(trajectory, time, passed)
            for key, trajectory in trajectories.items()
            if hasattr(trajectory, "event")
        ]
        self.path_time, self._passed, self._cursors, self._due = time, passed, cursors, None
        self.tasks, self.suspend_above, self._way = tuple(tasks), suspend_above, None
        self._returns: list[Return | None] = [None] * len(self.tasks)
        self._pending = [self.phase != FOLLOWING] * len(self.tasks)
        self._offsets: list[NDArray[np.float64] | None] = [None] * len(self.tasks)  # of pending tasks, last tick
        self._last: list[Any] = [None] * len(self.tasks)  # state and reference of suspended tasks, last tick
        self._changed = True

    @property
    def dt(self) -> float:
        """Tick [s]."""
        return self._dt

    @property
    def rules(self) -> RecoveryRules:
        """How to return."""
        return self._rules

    @property
    def kept(self) -> float:
        """What is left of the speed of a held task, from tick to tick."""
        return self._kept

    @property
    def way(self) -> Recovery | None:
        """The way back through the joints, while it is taken."""
        return self._way

    @property
    def clocks(self) -> tuple:
        """Phase, times on the path and on the returns; set them back when the robot could not go along."""
        way = None if self._way is None else self._way.clocks
        return self.path_time, self._rate, tuple(self._returns), tuple(self._pending), self._code, way, self._quiet

    @clocks.setter
    def clocks(self, clocks: tuple) -> None:
        self.path_time, self._rate = clocks[:2]
        self._returns, self._pending = list(clocks[2]), list(clocks[3])
        self._enter(clocks[4])
        self._due, self._quiet = None, clocks[6]
        if self._way is not None and clocks[5] is not None:
            self._way.clocks = clocks[5]

    def update(self, cdf_n: float, state: RobotState, activations: tuple[float, ...]) -> tuple[Any, ...]:
        """Advance one tick and give each task its reference.

        Args:
            cdf_n: Danger now.
            state: Commanded configuration.
            activations: a_1..a_N, one per task.

        Returns:
            One sample per task, in their order.

        Raises:
            ValueError: A trajectory is not finite; the phase stays as it was.
        """
        self.waits_for = ()
        before, of, rules = self._code, (self, state, activations), self._rules
        danger = not cdf_n <= self.suspend_above and rules.enabled
        self._quiet = quiet_after(self._quiet, cdf_n, rules.calm * self.suspend_above, self._dt)
        phase, anew = _next_phase(before, self._changed, danger, self._quiet <= rules.dwell, self.path_time, of)
        self._changed = False
        if phase != before:
            self._enter(phase)
        if anew:
            self._suspend()
        elif before == phase == steps.FOLLOWING:
            self.path_time, self._rate, waits = _advance(
                self.path_time, self._rate, self.paused, self._step, self._dt, bool(self._cursors), of
            )  # fmt: skip
            if waits:
                self.waits_for = self._not_met(state, (1.0,) * len(self.tasks))
        if self.phase == FOLLOWING and self._rate == 1.0 and True not in self._pending:  # the usual case, in short
            samples = [task.trajectory.sample(self.path_time) for task in self.tasks]
            # the clock stands while an event waits for its tasks: a reference that moved on would keep them from it
            return tuple([sample.slowed(0.0) for sample in samples] if self.waits_for else samples)
        if self.phase == SUSPENDED and before == phase and (rules.held or not danger):
            return tuple([self._reference(k, state, 0.0) for k in range(len(self.tasks))])
        if self.phase == SUSPENDED:
            held = [task.trajectory.sample(self.path_time).slowed(0.0) for task in self.tasks]
            self._last = [(state, sample) for sample in held]  # only the last tick's will be of interest
            return tuple(held)
        if self._way is not None:
            on_the_way = self._way.update(cdf_n, state, (min(activations),))
            if self._way.phase != FOLLOWING:
                return on_the_way
            self._way = None  # there: what is left is the way from a posture that met the tasks
        return tuple([self._reference(k, state, active) for k, active in enumerate(activations)])

    @property
    def on_path(self) -> bool:
        """Whether the references of this tick are the tasks' own trajectories, in place if not in speed."""
        return True not in self._pending

    def due_events(self) -> tuple[str, ...]:
        """Names of the events that the path has come to, in their order; until `pass_events` they are due again."""
        if not self._cursors:
            return ()
        looked = [(cursor, *cursor.due_until(self.path_time)) for cursor in self._cursors]
        found, due = [event for _, _, events in looked for event in events], [one[:2] for one in looked]
        self._due = due, {event for event in (*self._passed, *found) if event[0] == self.path_time}
        return tuple([name for _, name in sorted(found, key=itemgetter(0))])

    def pass_events(self) -> None:
        """The events that `due_events` has found have happened: each does so once."""
        if self._due:
            due, self._passed = self._due
            for cursor, count in due:
                cursor.count = count
        self._due = None

    def _enter(self, code: int) -> None:
        self._code, self.phase = code, PHASES[code]

    def lead(self, posture: NDArray[np.float64]) -> bool:
        """Return through the joints, straight to a posture (n,) [rad], and from there to the path.

        The way for a robot that is recovering and does not get on: joint limits that block the straight way of a pose
        never block that of the joints. It is taken once between two dangers.

        Returns:
            Whether it goes there now; `way` then has the task and, at every tick, its reference.
        """
        if self.phase != RECOVERING or self._led or not self.rules.enabled:
            return False
        task = JointTask(FixedJoints(posture))
        self._led, self._way = True, Recovery([task], self.suspend_above, self.dt, self.rules)
        self._way.set_tasks([task], self.suspend_above, restart=False)
        self._returns, self._offsets = [None] * len(self.tasks), [None] * len(self.tasks)
        self._pending = [True] * len(self.tasks)
        return True

    def _suspend(self) -> None:
        self._rate = 0.0
        self._way, self._led = None, False
        self._returns = [None] * len(self.tasks)
        self._pending = [True] * len(self.tasks)

    def _reference(self, k: int, state: RobotState, active: float) -> Any:
        task = self.tasks[k]
        sample = task.trajectory.sample(self.path_time)
        if self.phase != FOLLOWING or self._rate < 1.0:
            sample = sample.slowed(0.0 if self.phase != FOLLOWING else self._rate)
        if not self._pending[k]:
            return sample
        value = task.value(state)
        if not sample.finite:  # never into an offset, which remembers
            raise ValueError(f"the trajectory of the {task.name} task is not finite")
        offset, before, joints = task.offset(value, sample), self._offset_before(k), value.ndim == 1
        back, self._offsets[k] = self._returns[k], offset
        rate = np.zeros_like(offset) if before is None else (offset - before) / self.dt
        way = _way_on(back is not None, active >= 1.0, (self.rules, rate, joints, getattr(task, "rows", range(6))))
        if way == HOLD:
            self._returns[k] = None  # held, not pulled: its motion runs out
            return sample.displaced(offset, self._kept * rate)
        if back is None or way == SET_OUT:
            back = Return(offset, rate, self.rules.duration(offset, joints))  # x_d,r is where the task is now
        else:
            back = back.later(self.dt)
        self._returns[k] = back
        if back.time >= back.duration:
            self._returns[k], self._pending[k] = None, False
            return sample
        return back.displace(sample)

    def _offset_before(self, k: int) -> NDArray[np.float64] | None:
        """Offset of task k at the last tick, None if it was not finite or there was none."""
        if self._last[k] is not None:
            (state, sample), self._last[k] = self._last[k], None
            task = self.tasks[k]
            self._offsets[k] = task.offset(task.value(state), sample) if sample.finite else None
        return self._offsets[k]

    def _not_back(self, activations: tuple[float, ...]) -> tuple[str, ...]:
        """Names of the fully active tasks that are still on their way back."""
        tasks = zip(self.tasks, self._pending, activations, strict=True)
        return tuple([task.name for task, pending, active in tasks if pending and active >= 1.0])

    def _not_met(self, state: RobotState, activations: tuple[float, ...]) -> tuple[str, ...]:
        """Names of the essential and fully active tasks that are off the path, by more than the tolerance."""
        names = []
        for task, active in zip(self.tasks, activations, strict=True):
            if task.essential and active >= 1.0:
                error = task.error(task.value(state), task.trajectory.sample(self.path_time))
                if not float(np.linalg.norm(error)) <= self.rules.tolerance:
                    names.append(task.name)
        return tuple(names)
