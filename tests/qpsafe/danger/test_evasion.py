"""Evasive motion, eqs. (8), (14)-(16)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import qpsafe
from qpsafe.danger.evasion import Evasion, link_vectors, virtual_torque
from qpsafe.errors import ConfigurationError

robot = qpsafe.load_robot("irb140")


def spd(rng: np.random.Generator, n: int) -> np.ndarray:
    A = rng.normal(size=(n, n))
    return A @ A.T + 0.5 * np.eye(n)


@pytest.mark.parametrize("seed", range(4))
def test_filter_equals_the_differential_equation(seed: int) -> None:
    """(16) is M x' + D x = σ; with σ held over each sample the discrete filter is exact for any M, D."""
    rng = np.random.default_rng(seed)
    n, dt = 4, 0.05
    M, D = spd(rng, n), spd(rng, n)
    evasion = Evasion(M, D, n, dt)
    x = np.zeros(n)
    for sigma in rng.normal(size=(5, n)):
        x = solve_ivp(lambda _, x, s=sigma: np.linalg.solve(M, s - D @ x), (0, dt), x, rtol=1e-11, atol=1e-12).y[:, -1]
        assert evasion.step(sigma) == pytest.approx(x, rel=1e-7, abs=1e-9)


def test_steady_speed_is_torque_over_damping() -> None:
    evasion = Evasion(2.0, [1.0, 4.0, 8.0], 3)
    for _ in range(20_000):
        qd0 = evasion.step(np.array([1.0, 2.0, -4.0]))
    assert qd0 == pytest.approx([1.0, 0.5, -0.5], rel=1e-9)


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_filter_is_linear(a: float, b: float) -> None:
    rng = np.random.default_rng(3)
    inputs = rng.normal(size=(2, 6, 3))
    runs = [Evasion(1.5, 3.0, 3) for _ in range(3)]
    for u, v in zip(*inputs, strict=True):
        mixed = runs[2].step(a * u + b * v)
        assert mixed == pytest.approx(a * runs[0].step(u) + b * runs[1].step(v), abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_torque_is_the_power_of_the_forces(seed: int) -> None:
    """Virtual work: σᵀ q̇ equals Σ F_i (velocity of both ends of link i), whatever q̇."""
    rng = np.random.default_rng(seed)
    q, qd = rng.uniform(robot.lower, robot.upper), rng.normal(size=6)
    forces = rng.normal(size=(6, 3))
    wire = robot.wire(q, qd)
    power = np.sum(forces * (wire.start_velocities + wire.end_velocities))
    assert virtual_torque(robot.at(q), forces) @ qd == pytest.approx(power, rel=1e-9, abs=1e-12)


def test_obstacle_beside_the_arm_turns_the_waist_away() -> None:
    """A person on the robot's left (+y) must push the arm to its right: joint 1, about +z, goes negative."""
    field = qpsafe.DangerField()
    q = robot.home
    point = robot.pose("tcp", q)[:3, 3] + np.array([0.0, 0.4, 0.0])
    wire = robot.wire(q, np.zeros(6))
    forces = np.zeros((6, 3))
    forces[5] = field.vectors(point[None], wire)[0]
    assert virtual_torque(robot.at(q), forces)[0] < 0.0


def test_vectors_are_summed_link_by_link() -> None:
    vectors = np.arange(12.0).reshape(4, 3)
    total = link_vectors(vectors, np.array([2, 0, 2, 2]), 3)
    assert total == pytest.approx(np.array([vectors[1], [0, 0, 0], vectors[0] + vectors[2] + vectors[3]]))


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, [1.0, 2.0], [[1.0, 2.0], [0.0, 1.0]], "heavy", [[1, 2, 0]] * 3])
def test_matrices_that_are_not_positive_definite_are_refused(bad: object) -> None:
    with pytest.raises(ConfigurationError, match="damping"):
        Evasion(1.0, bad, 3)


@given(st.sampled_from([0, 1, 2, 3, 5, 7, 60, 10_000]), st.integers(0, 2), st.sampled_from([0.1, np.nan, np.inf]))
def test_what_is_no_vector_of_the_joints_never_reaches_compiled_code(size: int, ndim: int, value: float) -> None:
    """Compiled code does not look at sizes: it would read and write beyond the ends."""
    evasion, array = Evasion(4.0, 20.0, 4), np.full((size,) + (1,) * ndim, value)
    before = evasion.step(np.ones(4)).copy()
    with pytest.raises(ConfigurationError):
        evasion.velocity = array
    with pytest.raises(ConfigurationError):
        evasion.step(array)
    assert np.array_equal(evasion.velocity, before)


def test_the_velocity_can_be_set_and_is_copied() -> None:
    evasion, given_ = Evasion(4.0, 20.0, 4), np.array([1, 2, 3, 4], dtype=np.float32)
    evasion.velocity = given_
    given_[:] = 0.0
    faded = evasion.step(np.zeros(4))
    assert faded == pytest.approx(np.exp(-20.0 / 4.0 * 0.004) * np.array([1.0, 2.0, 3.0, 4.0]))
