"""Whether the robot stands off its goals, or moves without getting nearer, for no reason that will pass: say so.

Danger explains an error, and so does a reference that moves, or an error that shrinks. What is left is a goal out of
reach, a way that joint limits block, or a law that does not come to rest: it will not end by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.weighted import WeightedLaw

if TYPE_CHECKING:
    from qpsafe.laws.problem import Law
    from qpsafe.recovery.recovery import Recovery
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.tasks.task import Task

CALM = 0.01  # [rad/s] evasive velocity that does not explain motion
_BUNDLED = (HierarchicalLaw, NullspaceLaw, WeightedLaw)  # an own law may keep from what nobody else knows
PERIOD = 0.2  # [s] between two looks
_LESS = 0.95  # an error that has shrunk to this share has shrunk
_NOTHING = 1e-6  # [m or rad] errors below need not shrink
_BEHIND = 100.0  # tolerances that an error with a moving reference may grow to
_AT_LIMIT = 1e-3  # [rad] from a position limit
_MOVING = 0.01  # [rad/s] of joints that do not rest


class StallWatch:
    """Looks at the tasks' errors now and then.

    Args:
        robot: The robot, for its limits and names.
        dt: Tick [s].
        tolerance: Error norm up to which a task counts as met [m or rad].
        patience: Time without progress after which it is said [s].
    """

    def __init__(self, robot: Robot, dt: float, tolerance: float, patience: float) -> None:
        self.every = max(round(PERIOD / dt), 1)
        self._robot, self._tolerance = robot, tolerance
        self._looks = max(int(np.ceil(patience / (self.every * dt))), 1)  # within the patience
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._tasks: Sequence[Task] = ()
        #: Commanded joint position (n,) when all tasks, be they others, were last met; None if they never were.
        self.met: NDArray[np.float64] | None = None
        self.clear()

    def clear(self) -> None:
        """Start to watch anew."""
        #: What stands still, and by what; said at every tick until it has changed.
        self.messages: tuple[str, ...] = ()
        #: Whether the robot has to be held: it moves without getting nearer.
        self.held = False
        #: Whether it stands off its goals.
        self.stalled = False
        self._seen: list[tuple[Any, Any]] = []  # values, and their offsets from the references
        self._best, self._last = np.zeros(0), np.zeros(0)
        self._idle = 0  # looks without progress
        self._grown = np.zeros(0, dtype=int)  # looks in which a task's error grew

    def watch(
        self, tick: int, tasks: Sequence[Task], law: Law, recovery: Recovery, state: RobotState,
        qd: NDArray[np.float64], explained: bool, calm: bool,
    ) -> None:  # fmt: skip
        """See whether the robot does not get on, with nothing to explain it; lead it back another way if need be.

        Args:
            tick: Its number; it is looked at every `every` ticks.
            tasks, law: Of the controller.
            recovery: Where it is on its way back.
            state: Commanded configuration.
            qd: Commanded velocity (n,) [rad/s].
            explained: Whether danger or a sensor explains whatever errors there are.
            calm: Whether nothing but tasks moves the robot.
        """  # fmt: skip
        explained = explained or recovery.way is not None
        if explained and self.held:
            self.clear()
        if tick % self.every == 0:
            bundled = isinstance(law, _BUNDLED)
            self.look(tasks, state, qd, recovery.path_time, explained, calm and bundled)
            if self.stalled and self.met is not None and bundled and recovery.lead(self.met):
                self.clear()

    def look(
        self,
        tasks: Sequence[Task],
        state: RobotState,
        qd: NDArray[np.float64],
        time: float,
        explained: bool,
        calm: bool,
    ) -> None:
        """Look once.

        Args:
            tasks: Highest priority first.
            state: Commanded configuration.
            qd: Commanded velocity (n,) [rad/s].
            time: On the path [s].
            explained: Whether danger or something else explains whatever errors there are.
            calm: Whether nothing but tasks moves the robot.
        """
        if tasks is not self._tasks:
            self._tasks = tasks
            self.clear()
        samples = [task.trajectory.sample(time) for task in tasks]
        values = [task.value(state) for task in tasks]
        found = [task.error(*pair) for task, *pair in zip(tasks, values, samples, strict=True)]
        errors = np.array([float(np.linalg.norm(error)) for error in found])
        off = [task.essential and not error <= self._tolerance for task, error in zip(tasks, errors, strict=True)]
        if not any(off):
            self.met = state.q
        if explained:
            self.clear()
            return
        still = len(self._seen) == len(tasks) and all(
            np.array_equal(sample.offset(value), offset)  # the same reference, if it is as far from the same value
            for sample, (value, offset) in zip(samples, self._seen, strict=True)
        )
        self._seen = [(value, sample.offset(value)) for value, sample in zip(values, samples, strict=True)]
        if not still:
            self._follow(tasks, found, errors, state)
            return
        if self._idle == 0:
            self._best = np.full(len(tasks), np.inf)
        less = (errors < _LESS * self._best) & (self._best > _NOTHING)
        if (less & off).any() if any(off) else less.any():  # others' errors do not excuse those that are off
            self._idle, self.messages, self.held, self.stalled = 0, (), False, False
        self._best = np.where(less, errors, self._best)
        self._idle += 1
        if self._idle <= self._looks:
            return
        self.stalled = any(off)
        if calm and not self.held and float(np.abs(qd).max()) > _MOVING:
            self.held = True
            self.messages = (self._text("held: it moved without getting nearer to its goals", tasks, found, state),)
        elif self.stalled and not self.messages:
            self.messages = (self._text("stands off its goals", tasks, found, state),)

    def _follow(self, tasks: Sequence[Task], found: list[Any], errors: NDArray[np.float64], state: RobotState) -> None:
        """References that move."""
        self._idle, self.held, self.stalled = 0, False, False
        if len(self._last) == len(errors):
            essential = np.array([task.essential for task in tasks])
            grown = essential & (errors > self._last) & (errors > _BEHIND * self._tolerance)
            self._grown = np.where(grown, self._grown + 1, 0)
        else:
            self._grown = np.zeros(len(errors), dtype=int)
        self._last = errors
        if not (self._grown >= self._looks).any():
            self.messages = ()
        elif not self.messages:
            self.messages = (self._text("falls behind its goals", tasks, found, state),)

    def _text(self, what: str, tasks: Sequence[Task], found: list[Any], state: RobotState) -> str:
        amounts = []
        for task, error in zip(tasks, found, strict=True):
            if task.essential and not float(np.linalg.norm(error)) <= self._tolerance:
                linear = np.array([row < 3 for row in getattr(task, "rows", [])] or [False] * len(error))
                shift, turn = float(np.linalg.norm(error[linear])), float(np.linalg.norm(error[~linear]))
                parts = [f"{1e3 * shift:.1f} mm"] * bool(linear.any()) + [f"{turn:.3f} rad"] * (not linear.all())
                amounts.append(f"{task.name} by {' and '.join(parts)}")
        robot, q = self._robot, state.q
        sides = [("lower", q <= robot.lower + _AT_LIMIT), ("upper", q >= robot.upper - _AT_LIMIT)]
        at = [
            f"{name} at its {side} limit"
            for i, name in enumerate(robot.joint_names)
            for side, there in sides
            if there[i]
        ]
        why = "blocked by " + ", ".join(at) if at else "no joint at a limit: out of reach from this posture"
        return f"{what} ({', '.join(amounts) or 'met'}): {why}"
