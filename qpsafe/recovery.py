"""Suspension and recovery of the task's path, section IV-C of the source.

following ──danger above Δ(1-ε)──> suspended ──danger below──> recovering ──back at x_d,s──> following
                                        ^────────danger above────────┘
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.tasks.task import Task
    from qpsafe.tasks.trajectory import Sample, SmoothMove

FOLLOWING, SUSPENDED, RECOVERING = "following", "suspended", "recovering"


class Recovery:
    """Clock of the task's path, and the references that lead back to it.

    While suspended the path's clock stands still, x_d = x_d,s, ẋ_d = 0. When danger is past, a smooth move leads each
    frame from its pose then, x_d,r, to x_d,s. The path goes on when the moves have ended and every fully active task
    is back within `tolerance`.

    Args:
        tasks: The controller's tasks, highest priority first.
        suspend_above: Δ(1-ε), the danger beyond which the path is suspended.
        dt: Tick [s].
        speed: Peak speed of the recovery move [m/s].
        angular_speed: Peak angular speed of the recovery move [rad/s].
        tolerance: Largest error norm of a task at which it counts as recovered [m or rad].
    """

    def __init__(
        self,
        tasks: Sequence[Task],
        suspend_above: float,
        dt: float,
        speed: float = 0.25,
        angular_speed: float = 0.8,
        tolerance: float = 2e-3,
    ) -> None:
        self.tasks = tuple(tasks)
        self.suspend_above = suspend_above
        self.dt = dt
        self.speed, self.angular_speed, self.tolerance = speed, angular_speed, tolerance
        self.phase = FOLLOWING
        self.path_time = 0.0
        self._moves: dict[tuple[str, int], SmoothMove] = {}
        self._move_time = 0.0

    @property
    def clocks(self) -> tuple[float, float]:
        """Times on the path and on the recovery move [s]; set them back when the robot could not go along."""
        return self.path_time, self._move_time

    @clocks.setter
    def clocks(self, clocks: tuple[float, float]) -> None:
        self.path_time, self._move_time = clocks

    def update(
        self, cdf_n: float, pose: Callable[[str], NDArray[np.float64]], activations: tuple[float, ...]
    ) -> tuple[Sample, ...]:
        """Advance one tick and give each task its reference.

        Args:
            cdf_n: Danger now.
            pose: Commanded pose (4, 4) of a frame.
            activations: a_1..a_N, one per task.

        Returns:
            One sample per task, in their order.
        """
        if not cdf_n <= self.suspend_above:
            self.phase = SUSPENDED
        elif self.phase == SUSPENDED:
            self._start_moves(pose)
            self.phase = RECOVERING
        elif self.phase == RECOVERING:
            self._move_time += self.dt
            if self._recovered(pose, activations):
                self.phase = FOLLOWING
        else:
            self.path_time += self.dt
        return tuple(self._sample(task) for task in self.tasks)

    def _start_moves(self, pose: Callable[[str], NDArray[np.float64]]) -> None:
        from qpsafe.tasks.trajectory import SmoothMove

        self._move_time = 0.0
        self._moves = {}
        for task in self.tasks:
            key = (task.frame, id(task.trajectory))
            if key not in self._moves:  # tasks on one path of one frame share one move
                goal = task.trajectory.sample(self.path_time).pose
                if not np.isfinite(goal).all():  # a move would keep it: stay suspended, try again at the next tick
                    raise ValueError(f"the trajectory of the {task.name} task is not finite")
                self._moves[key] = SmoothMove(pose(task.frame), goal, self.speed, self.angular_speed)

    def _sample(self, task: Task) -> Sample:
        if self.phase == RECOVERING:
            return self._moves[task.frame, id(task.trajectory)].sample(self._move_time)
        sample = task.trajectory.sample(self.path_time)
        if self.phase == SUSPENDED:
            return sample._replace(twist=np.zeros(6))
        return sample

    def _recovered(self, pose: Callable[[str], NDArray[np.float64]], activations: tuple[float, ...]) -> bool:
        if any(self._move_time < move.duration for move in self._moves.values()):
            return False
        for task, activation in zip(self.tasks, activations, strict=True):
            error = task.error(pose(task.frame), task.trajectory.sample(self.path_time))
            if activation >= 1.0 and not float(np.linalg.norm(error)) <= self.tolerance:
                return False
        return True
