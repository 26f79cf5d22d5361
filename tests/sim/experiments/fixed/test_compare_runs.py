"""Whole runs: the QP form of the law against the paper's own, in closed loop with the plant."""

import numpy as np
import pytest
from amounts import some

import qpsafe
from qpsafe.laws.problem import LawProblem, LawResult, TaskVelocity
from qpsafe.sim.experiments.fixed.compare import Shadow, compare_closed_loop
from qpsafe.sim.people.choreography import Approach, Choreography

pytestmark = pytest.mark.long

#: Somebody comes so fast that the robot cannot evade within its limits.
HASTE = Choreography(
    (Approach(0.0, 0.0, 0.80, 0.60, medium_pause=0.2, close_pause=0.3),),
    duration=3.0,
    home_radius=1.8,
    approach_speed=1.4,
    close_speed=1.4,
    ramp=0.4,
    max_speed=2.5,
)


def test_joint_trajectories_are_equal_without_limits_and_differ_where_limits_bind() -> None:
    """Through low, medium and into high danger."""
    result = compare_closed_loop(qpsafe.load_robot("irb140"), some(16, of=22) / 10, choreography=HASTE)
    assert 0.0 < result.trajectory_deviation <= 1e-6  # two computations, the same motion
    assert result.largest_step_source > 2.0  # which no limit held back
    assert 100 < result.explained == result.different < result.ticks  # where they differ, a limit binds
    assert result.worst > 0.1
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
