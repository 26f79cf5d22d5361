"""What every law is given and what it returns: laws are interchangeable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.text.words import call

if TYPE_CHECKING:
    from qpsafe.hqp.level import Level
    from qpsafe.hqp.solution import Solution


class TaskVelocity(NamedTuple):
    """One task at one instant: find q̇ with jacobian @ q̇ = velocity.

    Attributes:
        jacobian: J (rows, n).
        velocity: ẋ (rows,), the CLIK velocity.
    """

    jacobian: NDArray[np.float64]
    velocity: NDArray[np.float64]


class LawProblem(NamedTuple):
    """The problem of one tick.

    Attributes:
        tasks: Highest priority first.
        qd0: Evasive velocity q̇0 (n,) [rad/s].
        activations: a_1 >= ... >= a_N in [0, 1], one per task (m, m f for two).
        lower: Lowest admissible q̇ (n,), or None without limits.
        upper: Highest admissible q̇ (n,), or None without limits.
        soft: Inequality levels (barriers) directly under the limits, before the first task; by default none.
        corrections: The part K e of each task's velocity that corrects its error, (rows,) each; by default nothing.
    """

    tasks: tuple[TaskVelocity, ...]
    qd0: NDArray[np.float64]
    activations: tuple[float, ...]
    lower: NDArray[np.float64] | None = None
    upper: NDArray[np.float64] | None = None
    soft: tuple[Level, ...] = ()
    corrections: tuple[NDArray[np.float64], ...] = ()


@dataclass(frozen=True)
class LawResult:
    """The answer of a law.

    Attributes:
        qd: Joint velocity (n,) [rad/s].
        status: ``"solved"``, or the first status of a solver that is not.
        regimes: (weight, solution) of every regime that was solved; empty for laws without solvers.
    """

    qd: NDArray[np.float64]
    status: str = "solved"
    regimes: tuple[tuple[float, Solution], ...] = ()

    def __repr__(self) -> str:
        return call(self, self.qd, self.status, weights=tuple([round(weight, 4) for weight, _ in self.regimes]))


class Law(Protocol):
    """A control law: joint velocity from tasks, evasive velocity, activations and limits."""

    def solve(self, problem: LawProblem) -> LawResult:
        """Solve one tick."""
        ...
