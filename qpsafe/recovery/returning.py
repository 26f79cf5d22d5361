"""What the tasks of a path remember of their way back, and the references that lead them there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.recovery.return_kernel import (
    ASKED,
    JOINTS,
    KNOWN,
    MOVES,
    PENDING,
    RETURNING,
    SIZE,
    TURNS,
    lead_references,
)
from qpsafe.robot.state import RobotState
from qpsafe.tasks.clik import is_plain
from qpsafe.tasks.task import PoseTask, Task
from qpsafe.tasks.trajectory import FixedPose, Sample

if TYPE_CHECKING:
    from qpsafe.recovery.returns import RecoveryRules

Array = NDArray[np.float64]
_NONE = np.empty(0)


class Led(Sequence[Any]):
    """References of tasks that are led back, one sample a task.

    Args:
        goals, twists: Of all tasks (N, 4, 4), (N, 6).
        wanted: Where the tasks' own trajectories are (N, 4, 4).
        asked: Samples in place of these, of tasks that were asked for theirs, by number.
    """

    __slots__ = ("asked", "goals", "twists", "wanted")

    def __init__(self, goals: Array, twists: Array, wanted: Array, asked: dict[int, Any]) -> None:
        self.goals, self.twists, self.wanted, self.asked = goals, twists, wanted, asked

    def __len__(self) -> int:
        return len(self.goals)

    def __getitem__(self, k: Any) -> Any:
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        k = range(len(self))[k]
        return self.asked[k] if k in self.asked else Sample(self.goals[k], self.twists[k])


class Returns:
    """Returns of the tasks of a path.

    A task on the pose of a frame is led in one compiled call together with all others of its kind; one whose value or
    offset is of another making, or whose trajectory gives other samples, is asked for its offset before and its sample
    displaced afterwards.

    Args:
        tasks: Highest priority first.
        rules: How to return.
        dt: Tick [s].
    """

    def __init__(self, tasks: Sequence[Task], rules: RecoveryRules, dt: float) -> None:
        count = len(tasks)
        self._tasks = tasks
        self._numbers = np.array(return_numbers(rules, dt))
        #: Which tasks have to come back.
        self.pending = [False] * count
        self._ours = [_is_ours(task) for task in tasks]
        #: Samples that are the same at every tick; they stand in what the references of a tick begin as.
        self._still: list[Sample | None] = [None] * count
        self._goals, self._twists = np.zeros((count, 4, 4)), np.zeros((count, 6))
        for k, task in enumerate(tasks):
            if self._ours[k] and type(task.trajectory) is FixedPose:
                self._goals[k], self._twists[k] = self._still[k] = task.trajectory.sample(0.0)
        self._kinds = np.array([_kind_of(task) + (6 << SIZE) for task in tasks], dtype=np.int64)
        self._sizes = [6] * count
        self._marks = np.zeros((count, 3), dtype=np.int64)
        self._returns, self._before = np.zeros((count, 14)), np.zeros((count, 6))
        self._drift, self._poses = np.empty((count, 2, 6)), np.empty((count, 4, 4))
        self._begun = False  # and nothing has changed since
        self._robot: Any = None
        self._frames: tuple[NDArray[np.int64], Array] = np.zeros(count, dtype=np.int64), np.zeros((count, 4, 4))

    @property
    def over(self) -> bool:
        """Whether no task has to come back."""
        return True not in self.pending

    def begin(self, anew: bool = False) -> None:
        """All tasks have to come back from where they will be.

        Args:
            anew: Whether it is not known where they were.
        """
        if not self._begun:
            self.pending, self._begun = [True] * len(self._tasks), True
            self._marks[:, PENDING], self._marks[:, RETURNING] = 1, 0
        if anew:
            self._marks[:, KNOWN] = 0

    @property
    def clocks(self) -> tuple[tuple[bool, ...], bytes, bytes] | None:
        """Which tasks have to come back, and where they are on their way; to be set back. None where all are over."""
        if True not in self.pending:
            return None
        return tuple(self.pending), self._marks.tobytes(), self._returns.tobytes()

    @clocks.setter
    def clocks(self, clocks: tuple[tuple[bool, ...], bytes, bytes] | None) -> None:
        count, self._begun = len(self._tasks), False
        if clocks is None:
            self.pending = [False] * count
            self._marks[:, (PENDING, RETURNING)] = 0
        elif len(clocks[0]) == count:  # else somebody has exchanged them meanwhile
            self.pending = list(clocks[0])
            marks = np.frombuffer(clocks[1], dtype=np.int64).reshape(count, -1)
            self._marks[:, (PENDING, RETURNING)] = marks[:, (PENDING, RETURNING)]
            self._returns[:] = _widened(np.frombuffer(clocks[2]).reshape(count, -1), self._before.shape[1])

    def know(self, state: RobotState, samples: Sequence[Any]) -> None:
        """Where the tasks were at the last tick: the offsets of a state from references."""
        for k, (task, sample) in enumerate(zip(self._tasks, samples, strict=True)):
            known = sample.finite
            if known:
                offset = np.asarray(task.offset(task.value(state), sample), dtype=float)
                self._sizes[k] = len(offset)
                self._make_room(len(offset))
                self._before[k, : len(offset)] = offset
            self._marks[k, KNOWN] = known

    def references(
        self, samples: Sequence[Any], share: float, state: RobotState, activations: tuple[float, ...]
    ) -> Led:
        """The samples on a clock that runs `share` times as fast, displaced where a task has to come back.

        Args:
            samples: Of the tasks' trajectories.
            share: 0 to 1.
            state: Commanded configuration.
            activations: Of the tasks; one that is released is not pulled.

        Raises:
            ValueError: A reference is not finite; nothing has changed.
        """
        count = len(samples)
        goals, twists = self._goals.copy(), self._twists.copy()
        asked: dict[int, tuple[Any, Array, int]] = {}
        plain, active = type(state) is RobotState, 0
        for k, sample in enumerate(samples):
            if activations[k] >= 1.0:
                active |= 1 << k
            still = self._still[k]
            if plain and still is not None and sample is still and not still.pose.flags.writeable:
                continue  # else somebody may have changed it in place
            if plain and self._ours[k] and type(sample) is Sample and is_plain(*sample):
                goals[k], twists[k] = sample
                continue
            asked[k] = self._ask(k, sample.slowed(share) if share != 1.0 else sample, state)
            goals[k], twists[k] = 0.0, 0.0
        if plain and state.robot is not self._robot:
            self._mount(state.robot)
        kinds, drift = self._kinds, self._drift
        if asked:
            kinds, drift = kinds.copy(), np.empty((count, 2, self._before.shape[1]))
            for k, (_, offset, kind) in asked.items():
                drift[k, 0, : len(offset)], kinds[k] = offset, kind
        wanted = goals.copy()
        self._begun = self._begun and not active  # what is released is only held
        done = lead_references(
            state.memory if plain else _NONE, *self._frames, kinds, self._numbers, active, share, self._marks,
            self._returns, self._before, goals, twists, drift, self._poses,
        )  # fmt: skip
        if done < 0:
            raise ValueError(f"the trajectory of the {self._tasks[-1 - done].name} task is not finite")
        if done:
            self.pending = [waits and not done >> k & 1 for k, waits in enumerate(self.pending)]
        told: dict[int, Any] = {}
        for k, (sample, offset, _) in asked.items():
            size = len(offset)
            told[k] = sample.displaced(drift[k, 0, :size], drift[k, 1, :size]) if self.pending[k] else sample
        return Led(goals, twists, wanted, told)

    def _ask(self, k: int, sample: Any, state: RobotState) -> tuple[Any, Array, int]:
        """A sample; the offset from it of a task that is pending, else none; what that is made of."""
        if not self.pending[k]:
            return sample, _NONE, ASKED
        task = self._tasks[k]
        value = task.value(state)
        if not sample.finite:  # never into an offset, which remembers
            raise ValueError(f"the trajectory of the {task.name} task is not finite")
        offset = np.array(task.offset(value, sample), dtype=float)
        size, joints = len(offset), np.ndim(value) == 1
        if not (offset.ndim == 1 and (joints or size == 6)):
            raise ValueError(f"the offset of the {task.name} task has shape {offset.shape}")
        if self._sizes[k] != size:
            self._make_room(size)
            self._sizes[k], self._marks[k, RETURNING], self._marks[k, KNOWN] = size, 0, 0
        return sample, offset, ASKED + (size << SIZE) + (JOINTS if joints else _kind_of(task))

    def _make_room(self, size: int) -> None:
        """For offsets of so many numbers."""
        count, width = self._before.shape
        if size > width:
            before = np.zeros((count, size))
            before[:, :width] = self._before
            self._before, self._returns = before, _widened(self._returns, size)
            self._drift = np.empty((count, 2, size))

    def _mount(self, robot: Any) -> None:
        """Take the places of the tasks' frames on a robot."""
        for k, (task, ours) in enumerate(zip(self._tasks, self._ours, strict=True)):
            if ours:
                self._frames[0][k], self._frames[1][k] = robot.mounting(task.frame)  # type: ignore[attr-defined]
        self._robot = robot


def return_numbers(rules: RecoveryRules, dt: float) -> tuple[float, ...]:
    """The numbers that `return_kernel` names: tick [s], and figures of the rules."""
    # what is left of the speed of a held task after a tick
    kept = math.exp(-dt / rules.fade)
    return dt, kept, rules.speed, rules.angular_speed, rules.joint_speed, rules.shortest


def _is_ours(task: Task) -> bool:
    """Whether the offset of a task is what compiled code takes it for: that of the pose of its frame."""
    own = isinstance(task, PoseTask) and type(task).value is PoseTask.value
    return own and type(task).offset is Task.offset


def _kind_of(task: Task) -> int:
    """What a task on a pose controls."""
    rows = getattr(task, "rows", range(6))
    return (MOVES if min(rows) < 3 else 0) + (TURNS if max(rows) >= 3 else 0)


def _widened(returns: Array, size: int) -> Array:
    """Returns with room for offsets of so many numbers."""
    count, width = len(returns), returns.shape[1] // 2 - 1
    if width == size:
        return returns
    wider = np.zeros((count, 2 + 2 * size))
    wider[:, : 2 + width], wider[:, 2 + size : 2 + size + width] = returns[:, : 2 + width], returns[:, 2 + width :]
    return wider
