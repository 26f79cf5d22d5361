"""Whether the robot stands off its goals, or moves without getting nearer, for no reason that will pass: say so.

Danger explains an error, and so does a reference that moves, or an error that shrinks. What is left is a goal out of
reach, a way that joint limits block, or a law that does not come to rest: it will not end by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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

Near = Callable[[], tuple[tuple[str, str, float], ...]]


def nothing_near() -> tuple[tuple[str, str, float], ...]:
    """Nothing is kept clear of."""
    return ()


CALM = 0.01  # [rad/s] evasive velocity that does not explain motion
_BUNDLED = (HierarchicalLaw, NullspaceLaw, WeightedLaw)  # an own law may keep from what nobody else knows
PERIOD = 0.2  # [s] between two looks
_LESS = 0.95  # an error that has shrunk to this share has shrunk
_NOTHING = 1e-6  # [m or rad] errors below need not shrink
BEHIND = 100.0  # tolerances that an error with a moving reference may grow to
_AT_LIMIT = 1e-3  # [rad] from a position limit
MOVING = 0.01  # [rad/s] of joints that do not rest

# what a watch remembers: of every task the least error, the last one, looks in which it grew; and marks
BEST, LAST, GROWN = range(3)
IDLE, SAID, HELD, STALLED, COMPARED = range(5)
#: What is said: nothing, that the robot is held, that it stands off its goals, that it falls behind them.
NOTHING, IS_HELD, STANDS_OFF, FALLSBEHIND = range(4)
TEXTS = (
    "", "held: it moved without getting nearer to its goals", "stands off its goals", "falls behind its goals",
)  # fmt: skip


def judge(
    errors: Any, off: Any, essential: Any, still: bool, restless: bool, bounds: tuple[int, float],
    amounts: Any, marks: Any,
) -> None:  # fmt: skip
    """Judge a look that nothing explains; written once for Python and for compiled code.

    Args:
        errors: Norms of the tasks' errors.
        off: Which tasks are essential and not met.
        essential: Which tasks are essential.
        still: Whether the references stand still.
        restless: Whether nothing but tasks moves the robot, and it moves.
        bounds: Looks without progress after which it is said, and errors that a task with a moving reference may have.
        amounts: Rows `BEST`, `LAST`, `GROWN`, a column a task; changed.
        marks: `IDLE`, looks without progress; `SAID`; `HELD`; `STALLED`; `COMPARED`, whether `LAST` is known; changed.
    """
    count, (patience, far) = len(errors), bounds
    if not still:  # references that move
        behind = False
        for k in range(count):
            known = marks[COMPARED] == 1
            grown = known and essential[k] != 0 and errors[k] > amounts[LAST, k] and errors[k] > far
            amounts[GROWN, k] = amounts[GROWN, k] + 1 if grown else 0
            amounts[LAST, k] = errors[k]
            behind = behind or amounts[GROWN, k] >= patience
        marks[IDLE], marks[HELD], marks[STALLED], marks[COMPARED] = 0, 0, 0, 1
        if not behind:
            marks[SAID] = NOTHING
        elif marks[SAID] == NOTHING:
            marks[SAID] = FALLSBEHIND
        return
    anybody, less, less_off = False, False, False
    for k in range(count):
        if marks[IDLE] == 0:
            amounts[BEST, k] = np.inf
        fell = errors[k] < _LESS * amounts[BEST, k] and amounts[BEST, k] > _NOTHING
        if fell:
            amounts[BEST, k] = errors[k]
        wrong = off[k] != 0
        anybody, less, less_off = anybody or wrong, less or fell, less_off or (fell and wrong)
    if less_off if anybody else less:  # others' errors do not excuse those that are off
        marks[IDLE], marks[SAID], marks[HELD], marks[STALLED] = 0, NOTHING, 0, 0
    marks[IDLE] += 1
    if marks[IDLE] <= patience:
        return
    marks[STALLED] = 1 if anybody else 0
    if restless and marks[HELD] == 0:
        marks[HELD], marks[SAID] = 1, IS_HELD
    elif anybody and marks[SAID] == NOTHING:
        marks[SAID] = STANDS_OFF


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
        #: Looks without progress after which it is said.
        self.patience = max(int(np.ceil(patience / (self.every * dt))), 1)  # within the patience
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
        self._amounts, self._marks = np.zeros((3, len(self._tasks))), [0] * 5

    def watch(
        self, tick: int, tasks: Sequence[Task], law: Law, recovery: Recovery, state: RobotState,
        qd: NDArray[np.float64], explained: bool, calm: bool, *, near: Near = nothing_near,
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
            near: Tells what the robot is kept clear of here: names and distances [m].
        """  # fmt: skip
        explained = explained or recovery.way is not None
        if explained and self.held:
            self.clear()
        if tick % self.every == 0:
            bundled = isinstance(law, _BUNDLED)
            self.look(tasks, state, qd, recovery.path_time, explained, calm and bundled, near)
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
        near: Near = nothing_near,
    ) -> None:
        """Look once.

        Args:
            tasks: Highest priority first.
            state: Commanded configuration.
            qd: Commanded velocity (n,) [rad/s].
            time: On the path [s].
            explained: Whether danger or something else explains whatever errors there are.
            calm: Whether nothing but tasks moves the robot.
            near: As for `watch`.
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
        restless = calm and float(np.abs(qd).max()) > MOVING
        essential, far = [task.essential for task in tasks], BEHIND * self._tolerance
        said = self._marks[SAID]
        judge(errors, off, essential, still, restless, (self.patience, far), self._amounts, self._marks)
        self.held, self.stalled = bool(self._marks[HELD]), bool(self._marks[STALLED])
        if self._marks[SAID] != said:
            said = self._marks[SAID]
            self.messages = (self._text(TEXTS[said], tasks, found, state, near()),) if said else ()

    def _text(
        self, what: str, tasks: Sequence[Task], found: list[Any], state: RobotState, near: tuple[Any, ...]
    ) -> str:
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
        at += [f"{link} {1e3 * gap:.1f} mm from {other}" for link, other, gap in near]
        why = "blocked by " + ", ".join(at) if at else "no joint at a limit: out of reach from this posture"
        return f"{what} ({', '.join(amounts) or 'met'}): {why}"
