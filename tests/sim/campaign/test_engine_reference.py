"""The engine's trials against MuJoCo's rays, distances and dynamics, tick by tick."""

import engine_against_mujoco as benchmark
import pytest

from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.speed import engine_speed


@pytest.mark.slow
@pytest.mark.parametrize("trial", [5, 0])
def test_a_trial_is_the_same_in_mujoco(trial: int) -> None:
    """Where people are near: by contact without control in the second one."""
    found = benchmark.compared(trial, ticks=800)
    assert found["compared"] == found["ticks"]
    assert found["hits"] > 100
    assert found["grazes"] == 0
    assert found["signs"] == 0
    assert found["readings"] < 1e-9
    assert found["references"] < 1e-9
    assert found["distances"] < 1e-8


@pytest.mark.slow
def test_dynamics_move_the_robot_a_little_otherwise() -> None:
    found = benchmark.compared(0, dynamics=True, ticks=900)
    assert 0.0 < found["joints"] < 0.1
    assert found["contact"] == found["contact_there"]


@pytest.mark.long
def test_the_engine_is_timed_beside_mujoco() -> None:
    speed = engine_speed(Plan(motions=("hold",)), trials=1, mujoco=True)
    assert speed.engine >= speed.planned > 0.0
    assert speed.ratio > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["default", "stop", "velocities"])
def test_more_trials_are_the_same_in_mujoco(controller: str) -> None:
    for trial in range(40, 52):
        found = benchmark.compared(trial, controller=controller)
        assert found["grazes"] <= 1e-3 * found["hits"]
        assert found["readings"] < 1e-6
        assert found["references"] < 1e-6
        assert found["distances"] < 1e-6
