"""Whole runs: the QP form of the law against the source's own, in closed loop with the plant."""

import numpy as np
import pytest

import qpsafe
from qpsafe.laws.problem import LawProblem, LawResult, TaskVelocity
from qpsafe.sim.compare import Shadow, compare_closed_loop


@pytest.mark.parametrize("duration", [9.0])
def test_joint_trajectories_are_equal_without_limits(duration: float) -> None:
    """Through low, medium and into high danger of the first approach."""
    result = compare_closed_loop(qpsafe.load_robot("irb140"), duration)
    assert result.trajectory_deviation <= 1e-6
    assert result.explained == result.different  # where they differ, a limit binds
    assert result.largest_step <= 1.0 + 1e-9


class Constant:
    def __init__(self, value: float) -> None:
        self.value = value

    def solve(self, problem: LawProblem) -> LawResult:
        return LawResult(np.full(len(problem.qd0), self.value))


def test_shadow_acts_as_the_first_law_and_measures_the_second() -> None:
    problem = LawProblem((TaskVelocity(np.eye(2), np.zeros(2)),), np.zeros(2), (1.0,), -np.ones(2), np.ones(2))
    shadow = Shadow(Constant(1.0), Constant(0.25))
    assert (shadow.solve(problem).qd == 1.0).all()
    shadow.solve(problem._replace(upper=np.full(2, 5.0)))
    assert shadow.deviations == [0.75, 0.75]
    assert shadow.binding == [True, False]
