"""A slow rail, lift or turntable under an arm leaves the evasion of its other joints as it is, and stable."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from qpsafe.danger.evasion import SPEED_SHARE, TIME_SHARE, Evasion
from qpsafe.danger.levers import levers
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.robot.loader import load_quietly
from qpsafe.robot.robot import Robot

SEEDS, DT, NEAR = st.integers(0, 2**32 - 1), 0.004, 0.3
UNDER = st.tuples(
    st.sampled_from(["prismatic", "revolute"]), st.sampled_from([0.25, 0.02]) | st.floats(1e-3, 0.25), st.integers(0, 2)
)


@pytest.fixture(scope="module")
def arm(arm_writer: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """An arm, with another axis under it or without."""
    path: Path = tmp_path_factory.mktemp("slow") / "arm.urdf"

    def made(seed: int, under: tuple[str, float, int] | None = None) -> Robot:
        axis = None if under is None else (*under[:2], np.eye(3)[under[2]])
        return load_quietly(arm_writer(seed).urdf(path, np.eye(4), axis))

    return made


def needed(robot: Robot) -> np.ndarray:
    """The least D of each joint [N m s/rad]: one point at the threshold turns it at its share of its speed."""
    return robot_thresholds(robot)[0].start * levers(robot) / (SPEED_SHARE * robot.max_velocity)


@settings(max_examples=some(15, 150))
@given(SEEDS, UNDER)
def test_other_joints_evade_as_without_it(arm: Any, seed: int, under: tuple[str, float, int]) -> None:
    """One D for all of them, by their own levers, whatever the slow one needs; that has its own."""
    alone, on_it = arm(seed), arm(seed, under)
    assume((levers(alone) * alone.max_velocity).max() > 0.5)  # else it is a gantry with a wrist: the slow one moves it
    slow = on_it.joint_names.index("under")
    without, found = Evasion.for_robot(alone, DT), Evasion.for_robot(on_it, DT)
    np.testing.assert_allclose(np.diag(without.damping), needed(alone).max(), rtol=1e-12)
    others = np.delete(np.diag(found.damping), slow)
    np.testing.assert_allclose(others, np.delete(needed(on_it), slow).max(), rtol=1e-12)
    assert (np.diag(found.damping) >= needed(on_it) * (1.0 - 1e-12)).all()
    times = np.diag(found.mass) / np.diag(found.damping)
    np.testing.assert_allclose(times, TIME_SHARE * on_it.max_velocity / on_it.max_acceleration)


@settings(max_examples=some(25, 300))
@given(SEEDS, st.none() | UNDER, st.integers(0, 5), st.integers(1, 4))
def test_moving_away_from_a_point_at_rest_does_not_swing(
    arm: Any, seed: int, under: tuple[str, float, int] | None, late: int, directions: int
) -> None:
    """Linear: σ = -K q, late by 0 to 20 ms, with K as large as the levers let it be at `NEAR`, whatever its shape.

    No mode grows: a spectral radius above 1 would be a cycle.
    """
    robot, rng = arm(seed, under), np.random.default_rng(seed)
    n, lever = robot.nq, levers(robot)
    shape = np.vstack((np.ones(n), rng.uniform(-1.0, 1.0, (directions - 1, n)))) * lever
    K = (
        robot_thresholds(robot)[0].start
        / (2.0 * NEAR)
        * shape.T
        @ (rng.dirichlet(np.ones(directions))[:, None] * shape)
    )
    A, B = Evasion.for_robot(robot, DT).matrices
    step = np.zeros(((late + 2) * n,) * 2)  # of q̇0, q, and q of the last ticks
    step[:n, :n], step[:n, -n:] = A, -B @ K
    step[n : 2 * n, :n], step[n : 2 * n, n : 2 * n] = DT * np.eye(n), np.eye(n)
    step[2 * n :, n:-n] = np.eye(late * n)
    assert np.abs(np.linalg.eigvals(step)).max() <= 1.0 + 1e-6
