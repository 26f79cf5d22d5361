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


class TaskErrors:
    """Errors of tasks at one instant.

    A task of somebody's own making may answer otherwise later: it is asked at once.

    Args:
        tasks: Highest priority first.
        state: Where the robot is.
        samples: Of the tasks' trajectories.
    """

    __slots__ = ("_made", "_of")

    def __init__(self, tasks: Sequence[Task], state: RobotState, samples: Sequence[Any]) -> None:
        self._made: tuple[Array, ...] | None = None
        of: list[Any] = []
        for task, sample in zip(tasks, samples, strict=True):
            if isinstance(task, PoseTask) and task.plain and type(sample) is Sample:
                of.append((task, state, Sample(np.array(sample.pose), sample.twist)))  # the array may be somebody's
            else:
                of.append(np.array(task.error(task.value(state), sample)))
        self._of = of

    @property
    def values(self) -> tuple[Array, ...]:
        """(rows,) each."""
        if self._made is None:
            self._made = tuple([of if isinstance(of, np.ndarray) else _error(*of) for of in self._of])
        return self._made

    @classmethod
    def of(cls, values: tuple[Array, ...]) -> TaskErrors:
        """Errors that are known."""
        made = cls.__new__(cls)
        made._of, made._made = [], values
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy keeps the numbers alone."""
        return TaskErrors.of, (self.values,)


def _error(task: Task, state: RobotState, sample: Sample) -> Array:
    return np.array(task.error(task.value(state), sample))
