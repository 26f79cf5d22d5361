"""The QP laws against the paper's over whole experiments: the second half of `qpsafe compare`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.problem import Law, LawProblem, LawResult
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.fixed.stage import robot_stage

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.people.choreography import Choreography


@dataclass
class Shadow:
    """A law that also asks another one the same question, without limits, and notes how far it is away.

    Attributes:
        law: The law that acts.
        other: The law that is only asked.
        deviations: Max-norm of the difference, one per tick [rad/s].
        binding: Whether the acting law touched a limit, one per tick.
    """

    law: Law
    other: Law
    deviations: list[float] = field(default_factory=list)
    binding: list[bool] = field(default_factory=list)

    def solve(self, problem: LawProblem) -> LawResult:
        """Answer with `law`."""
        result = self.law.solve(problem)
        other = self.other.solve(problem._replace(lower=None, upper=None))
        self.deviations.append(float(np.abs(result.qd - other.qd).max()))
        touched = problem.lower is not None and problem.upper is not None and _touches(problem, result)
        self.binding.append(bool(touched))
        return result


def _touches(problem: LawProblem, result: LawResult) -> bool:
    """Whether any solution in the blend lies on a limit."""
    assert problem.lower is not None
    assert problem.upper is not None
    solutions = [solution.qd for _, solution in result.regimes] or [result.qd]
    return any(
        ((qd <= problem.lower + 1e-12) | (qd >= problem.upper - 1e-12)).any()  # on the bound, to rounding
        for qd in solutions
    )


@dataclass(frozen=True)
class ClosedLoop:
    """Result of `compare_closed_loop`.

    Attributes:
        duration: Of each run [s].
        trajectory_deviation: Largest difference of commanded joint positions over the whole run with limits switched
            off: law (22) in one run, its QP form in the other [rad].
        ticks: Number of ticks with limits on.
        different: How many of them differ from (22) by more than 1e-8 rad/s.
        explained: How many of those had a limit binding in at least one regime.
        median, worst: Difference over those that differ [rad/s].
        largest_step: Largest change of q̇ per tick and joint relative to a_max dt, limits on; never above 1.
        largest_step_source: The same for law (22) with limits off.
    """

    duration: float
    trajectory_deviation: float
    ticks: int
    different: int
    explained: int
    median: float
    worst: float
    largest_step: float
    largest_step_source: float

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def compare_closed_loop(
    robot: Robot,
    duration: float = 60.0,
    solver: str | None = None,
    progress: Callable[[], None] | None = None,
    choreography: Choreography | None = None,
) -> ClosedLoop:
    """Run the first experiment three times: (22) and its QP form without limits, and the QP form with limits.

    Args:
        robot: The robot.
        duration: Length of each run [s].
        solver: Solver of the QPs.
        progress: Called after every tick, 3 duration / dt times.
        choreography: How the person moves; None for the first experiment's.
    """
    walk = robot_stage(robot).choreography if choreography is None else choreography

    def run(law: Law, limits: bool) -> Any:
        observer = None if progress is None else lambda *_: progress()
        return FixedExperiment(robot, law, limits=limits, duration=duration, choreography=walk).run(observer)

    source = run(NullspaceLaw(), False)
    free = run(HierarchicalLaw("paper", solver=solver), False)
    shadow = Shadow(HierarchicalLaw("paper", solver=solver), NullspaceLaw())
    limited = run(shadow, True)

    deviations, binding = np.array(shadow.deviations), np.array(shadow.binding)
    different = deviations > 1e-8
    some = deviations[different] if different.any() else np.zeros(1)
    step = robot.max_acceleration * limited.dt
    return ClosedLoop(
        duration=duration,
        trajectory_deviation=float(np.abs(source.q_ref - free.q_ref).max()),
        ticks=len(deviations),
        different=int(different.sum()),
        explained=int((different & binding).sum()),
        median=float(np.median(some)),
        worst=float(some.max()),
        largest_step=float((np.abs(np.diff(limited.qd_ref, axis=0)) / step).max()),
        largest_step_source=float((np.abs(np.diff(source.qd_ref, axis=0)) / step).max()),
    )
