"""Suspension and recovery of the tasks' path, section IV-C of the paper, as one small state machine.

following ──danger above Δ(1-ε)──> suspended ──danger small for a while──> recovering ──back at x_d,s──> following
                                        ^────────danger above────────┘
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.recovery import steps
from qpsafe.recovery.events import Cursor
from qpsafe.recovery.return_kernel import KEPT
from qpsafe.recovery.returning import Led, Returns, return_numbers
from qpsafe.recovery.returns import RecoveryRules
from qpsafe.recovery.steps import FINITE, MET, PHASES, quiet_after
from qpsafe.tasks.errors import TaskErrors, answers_alike
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


_next_phase, _advance = steps.phases_by(_answer)


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
        self.path_time, self.paused = 0.0, False
        #: Names of the tasks that the path waits for: not back yet, or not met when an event is due.
        self.waits_for: tuple[str, ...] = ()
        #: The tasks' own references at this tick; None where they were not asked for.
        self._samples: list[Any] | None = None
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
        self._returns = Returns(self.tasks, self._rules, self._dt)
        self._asked = [k for k, task in enumerate(self.tasks) if not answers_alike(task)]  # for their errors, at once
        if self.phase != FOLLOWING:
            self._returns.begin()
        self._last: tuple[Any, Any] | None = None  # state and references of suspended tasks, last tick
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
        return return_numbers(self._rules, self._dt)[KEPT]

    @property
    def way(self) -> Recovery | None:
        """The way back through the joints, while it is taken."""
        return self._way

    @property
    def clocks(self) -> tuple:
        """Phase, times on the path and on the returns; set them back when the robot could not go along."""
        way = None if self._way is None else self._way.clocks
        return self.path_time, self._rate, self._returns.clocks, self._code, way, self._quiet

    @clocks.setter
    def clocks(self, clocks: tuple) -> None:
        self.path_time, self._rate, self._returns.clocks, code, way, self._quiet = clocks
        self._enter(code)
        self._due = None
        if self._way is not None and way is not None:
            self._way.clocks = way

    def update(self, cdf_n: float, state: RobotState, activations: tuple[float, ...]) -> Sequence[Any]:
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
        self.waits_for, self._samples = (), None
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
        if self.phase == SUSPENDED and not (before == phase and (rules.held or not danger)):
            held = [sample.slowed(0.0) for sample in self._sampled()]
            self._last = state, held  # only the last tick's will be of interest
            return tuple(held)
        if self._way is not None and self.phase != SUSPENDED:
            on_the_way = self._way.update(cdf_n, state, (min(activations),))
            if self._way.phase != FOLLOWING:
                return on_the_way
            self._way = None  # there: what is left is the way from a posture that met the tasks
        samples, share = self._sampled(), self._rate if self.phase == FOLLOWING else 0.0
        if self._returns.over:
            if self.waits_for and share == 1.0:  # a reference that moved on would keep them from the event they wait at
                share = 0.0
            return tuple(samples if share == 1.0 else [sample.slowed(share) for sample in samples])
        if self._last is not None:
            self._returns.know(*self._last)
            self._last = None
        released = self.phase == SUSPENDED
        return self._returns.references(samples, share, state, (0.0,) * len(samples) if released else activations)

    @property
    def on_path(self) -> bool:
        """Whether the references of this tick are the tasks' own trajectories, in place if not in speed."""
        return self._returns.over

    def errors(self, state: RobotState, references: Sequence[Any]) -> TaskErrors:
        """Of the tasks against their own trajectories.

        Args:
            state: Commanded configuration of this tick.
            references: What `update` returned.
        """
        samples = self._sampled() if self._samples is None else self._samples
        if type(references) is not Led or references.asked:
            return TaskErrors.against(samples, self.tasks, state)
        asked = {k: np.array(self.tasks[k].error(self.tasks[k].value(state), samples[k])) for k in self._asked}
        return TaskErrors(self.tasks, state, references.wanted, asked)

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
        self._returns.begin(anew=True)
        return True

    def _suspend(self) -> None:
        self._rate = 0.0
        self._way, self._led = None, False
        self._returns.begin()

    def _sampled(self) -> list[Any]:
        """The tasks' own references at the time on the path."""
        time = self.path_time
        self._samples = [task.trajectory.sample(time) for task in self.tasks]
        return self._samples

    def _not_back(self, activations: tuple[float, ...]) -> tuple[str, ...]:
        """Names of the fully active tasks that are still on their way back."""
        tasks = zip(self.tasks, self._returns.pending, activations, strict=True)
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
