"""Errors of tasks against their own trajectories, from numbers that stay, computed when they are looked at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.tasks.task import PoseTask, Task
from qpsafe.tasks.trajectory import Sample

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState

Array = NDArray[np.float64]
_STILL = np.zeros(6)


class TaskErrors:
    """Errors of tasks at one instant.

    Args:
        tasks: Highest priority first.
        state: Where the robot is.
        goals: Poses that the tasks' frames should have (N, 4, 4), nobody else's array.
        known: Errors that are known already, by the number of the task.
    """

    __slots__ = ("_known", "_made", "_of")

    def __init__(self, tasks: Sequence[Task], state: RobotState, goals: Array, known: dict[int, Array]) -> None:
        self._of: Any = tasks, state, goals
        self._known = known
        self._made: tuple[Array, ...] | None = None

    @classmethod
    def against(cls, samples: Sequence[Any], tasks: Sequence[Task], state: RobotState) -> TaskErrors:
        """Errors against samples of the tasks' trajectories.

        Args:
            samples: One a task.
            tasks: Highest priority first.
            state: Where the robot is.
        """
        goals, known = np.empty((len(tasks), 4, 4)), {}
        for k, (task, sample) in enumerate(zip(tasks, samples, strict=True)):
            if answers_alike(task) and type(sample) is Sample and np.shape(sample.pose) == (4, 4):
                goals[k] = sample.pose
            else:
                known[k] = np.array(task.error(task.value(state), sample))
        return cls(tasks, state, goals, known)

    @classmethod
    def of(cls, values: tuple[Array, ...]) -> TaskErrors:
        """Errors that are known."""
        made = cls.__new__(cls)
        made._made = values
        return made

    @property
    def values(self) -> tuple[Array, ...]:
        """(rows,) each."""
        if self._made is None:
            tasks, state, goals = self._of
            self._made = tuple([self._error(k, task, state, goals[k]) for k, task in enumerate(tasks)])
        return self._made

    def _error(self, k: int, task: Task, state: RobotState, goal: Array) -> Array:
        return self._known[k] if k in self._known else np.array(task.error(task.value(state), Sample(goal, _STILL)))

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy keeps the numbers alone."""
        return TaskErrors.of, (self.values,)


def answers_alike(task: Task) -> bool:
    """Whether a task's error is known to depend on its frame's pose and the wanted one alone, now and later."""
    return isinstance(task, PoseTask) and task.plain
