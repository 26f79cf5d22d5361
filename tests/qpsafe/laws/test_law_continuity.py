"""Commands are continuous within the acceleration limits, whatever tasks, activations, danger and pose do."""

import numpy as np
import pytest
from amounts import first, some

import qpsafe
from qpsafe.laws.problem import LawProblem, TaskVelocity
from qpsafe.limits import JointLimits

ROBOT = qpsafe.load_robot("irb140")
DT = 0.004
LAWS = {
    "strict": qpsafe.HierarchicalLaw("strict"),
    "strict, damped": qpsafe.HierarchicalLaw("strict", damping=0.02),
    "paper": qpsafe.HierarchicalLaw("paper"),
    "weighted": qpsafe.WeightedLaw(),
}


@pytest.mark.parametrize("name", LAWS)
def test_velocity_steps_stay_within_the_acceleration_limit(name: str) -> None:
    """Random jumps of activations, task order, targets, evasive velocity and soft levels at once, again and again."""
    law, rng = LAWS[name], np.random.default_rng(3)
    limits = JointLimits(ROBOT.lower, ROBOT.upper, ROBOT.max_velocity, ROBOT.max_acceleration, DT)
    q, qd = ROBOT.home.copy(), np.zeros(6)
    for tick in range(some(600, of=1500)):
        if tick % 37 == 0:  # everything jumps at once
            activations = tuple(np.cumprod(rng.choice((0.0, 0.3, 1.0), 2)))
            swapped, qd0 = rng.random() < 0.5, rng.normal(size=6) * rng.choice((0.1, 2.0, 50.0))
            xd = rng.normal(size=6) * rng.choice((0.0, 0.2, 5.0))
            soft = (qpsafe.Level(rng.normal(size=(2, 6)), -np.inf, rng.normal(size=2)),) * int(rng.random() < 0.3)
        J, box = ROBOT.jacobian("tcp", q), limits.box(q, qd)
        tasks = (TaskVelocity(J[:3], xd[:3]), TaskVelocity(J[3:], xd[3:]))
        result = law.solve(LawProblem(tasks[::-1] if swapped else tasks, qd0, activations, box.lower, box.upper, soft))
        assert result.status == "solved"
        assert (np.abs(result.qd - qd) <= ROBOT.max_acceleration * DT + 1e-9).all()
        q, qd = q + result.qd * DT, result.qd
        assert (q >= ROBOT.lower - 1e-9).all()
        assert (q <= ROBOT.upper + 1e-9).all()


@pytest.mark.parametrize("crossing", first(1, ["wrist", "elbow"]))
def test_damping_keeps_speeds_bounded_and_continuous_through_a_singular_pose(crossing: str) -> None:
    """Without any limits: the same sweep through the singular pose, undamped and damped."""
    xd = np.array([0.02, 0.05, -0.03, 0.2, -0.1, 0.3])

    def sweep(law: qpsafe.HierarchicalLaw) -> np.ndarray:
        result = []
        for s in np.linspace(-0.05, 0.05, some(2001, of=4001)):
            q = ROBOT.home + 0.1
            q[4 if crossing == "wrist" else 2] = s if crossing == "wrist" else -np.pi / 2 + s
            J = ROBOT.jacobian("tcp", q)
            tasks = (TaskVelocity(J[:3], xd[:3]), TaskVelocity(J[3:], xd[3:]))
            result.append(law.solve(LawProblem(tasks, np.zeros(6), (1.0, 1.0))).qd)
        return np.array(result)

    plain, damped = sweep(qpsafe.HierarchicalLaw()), sweep(qpsafe.HierarchicalLaw(damping=0.05))
    assert np.abs(damped).max() < 0.2 * np.abs(plain).max()
    assert np.abs(np.diff(damped, axis=0)).max() < 0.05 * np.abs(np.diff(plain, axis=0)).max()


def test_damping_never_reaches_the_task_above() -> None:
    """At a singular wrist the orientation task is damped; the position task above is met all the same."""
    q = ROBOT.home.copy()
    q[4] = 1e-4
    J, xd = ROBOT.jacobian("tcp", q), np.array([0.1, -0.2, 0.05, 1.0, -1.0, 0.5])
    tasks = (TaskVelocity(J[:3], xd[:3]), TaskVelocity(J[3:], xd[3:]))
    qd = qpsafe.HierarchicalLaw(damping=0.05).solve(LawProblem(tasks, np.zeros(6), (1.0, 1.0))).qd
    assert J[:3] @ qd == pytest.approx(xd[:3], abs=1e-9)
    assert np.abs(qd).max() < 100.0


@pytest.mark.parametrize("setting", [{"damping": -1.0}, {"damping": np.nan}, {"damping": 0.1, "solver": "daqp"}])
def test_wrong_damping_is_refused(setting: dict) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match="damping"):
        qpsafe.HierarchicalLaw(**setting)


def _near_a_singular_wrist(angle: float, errors: float) -> LawProblem:
    """Two tasks whose errors have this size, ẋ_d = 0, K = 1 and 10."""
    q = ROBOT.home.copy()
    q[4] = angle
    J = ROBOT.jacobian("tcp", q)
    corrections = errors * np.array([0.2, -0.1, 0.1]), 10.0 * errors * np.array([0.5, 0.3, -0.4])
    tasks = TaskVelocity(J[:3], corrections[0]), TaskVelocity(J[3:], corrections[1])
    return LawProblem(tasks, np.zeros(6), (1.0, 1.0), corrections=corrections)


@pytest.mark.parametrize("errors", first(1, [1e-1, 1.0, 1e-2]))
def test_errors_are_corrected_at_bounded_gain_near_a_singular_pose(errors: float) -> None:
    """dq̇/dq stays below some 1/μ whatever the errors, and grows without bound undamped."""
    angles = np.linspace(-0.05, 0.05, 2001)

    def steepest(law: qpsafe.HierarchicalLaw) -> float:
        qd = np.array([law.solve(_near_a_singular_wrist(a, errors)).qd for a in angles])
        return float(np.abs(np.diff(qd, axis=0)).max() / (angles[1] - angles[0]))

    assert steepest(qpsafe.HierarchicalLaw()) < 3.0 / 0.04
    assert steepest(qpsafe.HierarchicalLaw(damping_time=0.0)) > 100.0 / 0.04 * errors


def test_damping_goes_with_the_errors() -> None:
    """Tasks that are met, on the move or not, are never damped; neither is a law that is not told of errors."""
    plain = qpsafe.HierarchicalLaw(damping_time=0.0)
    for angle in (1e-6, 1e-3, 0.05):
        problem = _near_a_singular_wrist(angle, 1.0)
        for corrections in ((), (np.zeros(3), np.zeros(3))):
            told = problem._replace(corrections=corrections)
            assert np.array_equal(qpsafe.HierarchicalLaw().solve(told).qd, plain.solve(told).qd)


@pytest.mark.parametrize("options", [{"projection": "paper"}, {"solver": "daqp"}])
def test_what_has_to_be_equal_to_something_is_not_damped_by_default(options: dict) -> None:
    assert qpsafe.HierarchicalLaw(**options).damping_time == 0.0
    assert qpsafe.HierarchicalLaw().damping_time > 0.0
    with pytest.raises(qpsafe.ConfigurationError, match="damping_time"):
        qpsafe.HierarchicalLaw(damping_time=-1.0)
