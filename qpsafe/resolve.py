"""The second half of a tick in one compiled call, where all of it is of the built-in kind: tasks, limits, law.

    tasks on poses --CLIK--> J, ẋ;   limits --> box;   J, ẋ, q̇0, weights, box --regimes--> q̇;   q̇ --box--> command

`resolve` says it in plain words, for tasks, laws and limits of any kind; `Resolver` computes the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.checks import checked_velocity
from qpsafe.hqp.own_hierarchy import HEADER
from qpsafe.hqp.own_regimes import layout_for
from qpsafe.hqp.solution import SOLVED
from qpsafe.laws.hierarchical import BlendResult, HierarchicalLaw, weights_of
from qpsafe.laws.problem import LawProblem, LawResult, TaskVelocity
from qpsafe.limits import Box, JointLimits
from qpsafe.resolve_kernel import Parts, parts, resolve_quickly
from qpsafe.tasks.task import PoseTask

if TYPE_CHECKING:
    from collections.abc import Sequence

    from qpsafe.hqp.level import Level
    from qpsafe.laws.problem import Law
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.tasks.task import Task

Array = NDArray[np.float64]
_FLOAT = np.dtype(np.float64)


@dataclass
class Resolved:
    """What is to be done in a tick.

    Attributes:
        command: Joint velocity (n,) [rad/s], inside the box.
        excess: By how much the law's answer was outside; NaN if a limit gave way.
        solved: Whether the law answered as planned.
        box: Admissible velocities.
        result: The law's answer; None if it was not asked.
        errors: Of the tasks against their references of this tick.
    """

    command: Array
    excess: float
    solved: bool
    box: Box | None
    result: LawResult | None
    errors: tuple[Array, ...]


def resolve(
    commanded: RobotState,
    tasks: Sequence[Task],
    samples: Sequence[Any],
    qd0: Array,
    activations: tuple[float, ...],
    law: Law,
    box: Box | None,
    soft: tuple[Level, ...],
    dt: float,
) -> Resolved:
    """Tasks, limits and law one after the other, of any kind.

    Args:
        commanded: Commanded configuration.
        tasks: Highest priority first.
        samples: Their references.
        qd0: Evasive velocity (n,) [rad/s].
        activations: Of the tasks.
        law: The law.
        box: Admissible velocities, or None.
        soft: Levels under the limits.
        dt: Tick [s].

    Raises:
        ValueError, TypeError: What the law returned could not be sent to a robot.
    """  # fmt: skip
    wanted = [task.clik(commanded, sample) for task, sample in zip(tasks, samples, strict=True)]
    wishes = tuple([TaskVelocity(jacobian, velocity) for jacobian, velocity, _ in wanted])
    lower, upper = (box.lower.copy(), box.upper.copy()) if box else (None, None)
    corrections = tuple([task.gain * clik.error for task, clik in zip(tasks, wanted, strict=True)])
    result = law.solve(LawProblem(wishes, qd0.copy(), activations, lower, upper, soft, corrections))
    answer = checked_velocity(result, commanded.q, dt)
    command, excess = box.admit(answer) if box else (answer.copy(), 0.0)
    return Resolved(command, excess, result.status == SOLVED, box, result, tuple([clik.error for clik in wanted]))


def judged(resolved: Resolved, names: tuple[str, ...]) -> tuple[str, ...]:
    """What was unusual, in words: limits that gave way, a law that exceeded them, a solver that did not finish."""
    box, result = resolved.box, resolved.result
    assert result is not None
    messages: tuple[str, ...] = ()
    if box is not None and not resolved.excess <= 1e-9:
        beyond = np.abs(box.clip(result.qd) - result.qd) > 1e-9
        messages = box.notes(names)
        if beyond.any():
            clipped = ", ".join(name for name, much in zip(names, beyond, strict=True) if much)
            messages = (*messages, "the law exceeded the limits, clipped: " + clipped)
    return messages if resolved.solved else (*messages, f"law: {result.status}")


class Resolver:
    """Resolves ticks of one set of tasks.

    Args:
        robot: The robot.
        tasks: Tasks on poses, all of the built-in kind.
        law: The law.
        limits: The limits.
    """

    def __init__(self, robot: Robot, tasks: Sequence[PoseTask], law: HierarchicalLaw, limits: JointLimits) -> None:
        counts = tuple(len(task.rows) for task in tasks)
        self._tasks, self._law, self._counts = tuple(tasks), law, counts
        mountings = [robot.mounting(task.frame) for task in tasks]
        self._tables = (
            robot.tree.supports,
            robot.ends,
            np.array([body for body, _ in mountings], dtype=np.int64),
            np.array([placement for _, placement in mountings]),
            np.array([row for task in tasks for row in task.rows], dtype=np.int64),
            np.array((limits.lower, limits.upper, limits.max_velocity, limits.max_acceleration)),
            limits.dt,
            limits.return_speed,
        )
        self._goals, self._twists = np.empty((len(tasks), 4, 4)), np.empty((len(tasks), 6))
        self._gains = np.empty(len(tasks))
        self._layout = layout_for(robot.nq, counts)
        n, rows, kinds = robot.nq, sum(counts), len(tasks) + 1
        self._weights = np.empty(kinds)
        self._floats = rows * n + 2 * rows + (3 + kinds) * n + kinds  # of `parts`, and scratch
        self._integers = 3 * n + kinds * (HEADER + 2 * n + rows)

    @staticmethod
    def fits(tasks: Sequence[Task], law: Any, limits: Any) -> bool:
        """Whether everything is of the kind that the compiled call knows."""
        return (
            type(limits) is JointLimits
            and limits.max_jerk is None
            and type(law) is HierarchicalLaw
            and law.solver in (None, "own")
            and (law.projection == "strict" or len(tasks) == 1)
            and all(isinstance(task, PoseTask) and task.plain for task in tasks)
        )

    def __call__(
        self, state: RobotState, qd: Array, samples: Sequence[Any], qd0: Array, activations: tuple[float, ...]
    ) -> Resolved | None:
        """Resolve one tick; None where a sample is not made of plain arrays.

        Args:
            state: Commanded configuration.
            qd: Commanded velocity (n,) [rad/s].
            samples: Reference of every task.
            qd0: Evasive velocity (n,) [rad/s].
            activations: Of the tasks.
        """
        begin = perf_counter()
        goals, twists, gains, weights = self._goals, self._twists, self._gains, self._weights
        for k, sample in enumerate(samples):
            pose, twist = sample.pose, sample.twist
            if not (type(pose) is type(twist) is np.ndarray and pose.dtype is twist.dtype is _FLOAT):
                return None
            if pose.shape != (4, 4) or twist.shape != (6,):
                return None
            goals[k], twists[k], gains[k] = pose, twist, self._tasks[k].gain
        weights[:] = given = weights_of(activations)
        command, floats, integers = np.empty(len(qd)), np.zeros(self._floats), np.zeros(self._integers, dtype=np.int64)
        excess, worst = resolve_quickly(
            state.q, qd, state.memory, *self._tables, gains, goals, twists, qd0, weights, self._law.damping,
            self._law.damping_time, *self._layout, floats, integers, command,
        )  # fmt: skip
        if excess < 0.0:
            raise ValueError(f"the law returned a velocity that is not finite or absurd: {command}")
        taken = perf_counter() - begin
        return QuicklyResolved(command, excess, worst == 0.0, (floats, integers, qd0, given, self._counts, taken))


class QuicklyResolved(Resolved):
    """`Resolved` by one compiled call: the arrays it filled are cut, and explained, when they are looked at.

    Args:
        command, excess, solved: As for `Resolved`.
        filled: Results of `resolve_quickly`, the evasive velocity, the regimes' weights, rows of each task, time [s].
    """

    def __init__(self, command: Array, excess: float, solved: bool, filled: tuple[Any, ...]) -> None:
        self.command, self.excess, self.solved, self._filled = command, excess, solved, filled

    @cached_property
    def _parts(self) -> Parts:
        floats, integers, _, weights, counts, _ = self._filled
        return Parts(*parts(floats, integers, len(self.command), sum(counts), len(weights)))

    @cached_property
    def box(self) -> Box:  # type: ignore[override]
        """Admissible velocities."""
        return Box(*self._parts.bounds, *self._parts.codes)

    @cached_property
    def result(self) -> LawResult:  # type: ignore[override]
        """The law's answer."""
        cut, (_, _, qd0, weights, counts, taken) = self._parts, self._filled
        data = (cut.A, cut.b, qd0, *cut.bounds)
        return BlendResult(cut.blend, cut.x, cut.info, weights, data, counts, taken, self.solved)

    @cached_property
    def errors(self) -> tuple[Array, ...]:  # type: ignore[override]
        """Of the tasks."""
        ends = [0, *accumulate(self._filled[4])]
        return tuple([self._parts.e[first:last] for first, last in pairwise(ends)])
