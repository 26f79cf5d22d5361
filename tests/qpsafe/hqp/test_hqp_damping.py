"""Damping: bounded and continuous through a singular pose, unnoticed above, absent elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.hqp.solve import solve_hierarchy

EPSILON = 0.1


def arm(angle):
    """Position Jacobian, (2, 3), of a planar arm that is stretched out at angle 0."""
    sums, lengths = np.cumsum([0.3, angle, -angle]), np.array([1.0, 1.0, 0.5])
    columns = [(lengths[j:] * np.array([-np.sin(sums[j:]), np.cos(sums[j:])])).sum(axis=1) for j in range(3)]
    return np.array(columns).T


def crossing(damping):
    """q̇ for a constant task while the elbow passes through the stretched pose."""
    angles = np.linspace(-0.2, 0.2, 2001)  # 0 is among them
    levels = [[(arm(a), np.array([0.7, -0.5])), (np.eye(3), np.array([0.1, 0.8, -0.4]))] for a in angles]
    return np.array([solve_hierarchy(pair, damping=damping).qd for pair in levels])


def test_speed_is_bounded_and_continuous_through_the_singularity():
    undamped, damped = crossing(0.0), crossing(EPSILON)
    bound = np.linalg.norm([0.7, -0.5]) / EPSILON + 2.0
    assert np.abs(undamped).max() > 10.0 * bound
    assert np.abs(damped).max() < bound
    steps = np.abs(np.diff(damped, axis=0)).max(axis=1)
    assert steps.max() < 3.0 * 2e-4 * bound / EPSILON  # Lipschitz in the pose: what one step of 2e-4 rad may do
    assert steps.max() < 1e-3 * np.abs(np.diff(undamped, axis=0)).max()


def test_the_lost_direction_belongs_to_the_levels_below():
    levels = [(arm(0.0), np.array([0.7, -0.5])), (np.eye(3), np.array([0.1, 0.8, -0.4]))]
    np.testing.assert_allclose(
        solve_hierarchy(levels, damping=EPSILON).qd, solve_hierarchy(levels).qd, rtol=0, atol=1e-12
    )


def test_nothing_changes_away_from_singularities():
    rng = np.random.default_rng(0)
    for _ in range(50):
        A, b = rng.standard_normal((3, 6)), rng.standard_normal(3)
        levels, box = [(A, b), (np.eye(6), rng.standard_normal(6))], rng.uniform(0.2, 1.0, 6)
        smallest = np.linalg.svd(A, compute_uv=False)[-1]
        plain = solve_hierarchy(levels, -box, box)
        damped = solve_hierarchy(levels, -box, box, damping=0.99 * smallest)
        np.testing.assert_allclose(damped.qd, plain.qd, rtol=0, atol=1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 1e-1])
def test_levels_above_notice_nothing(size):
    rng = np.random.default_rng(1)
    for _ in range(30):
        H, L = rng.standard_normal((2, 3, 7))
        L[2] = L[0] + H[1] + size * rng.standard_normal(7)  # nearly in the span of what is fixed
        levels = [(H, rng.standard_normal(3)), (L, rng.standard_normal(3)), (np.eye(7), rng.standard_normal(7))]
        box = rng.uniform(0.2, 2.0, 7)
        plain, damped = solve_hierarchy(levels, -box, box), solve_hierarchy(levels, -box, box, damping=0.3)
        assert damped.status == "solved"
        assert np.all(np.abs(damped.qd) <= box)
        assert damped.residuals[0] == pytest.approx(plain.residuals[0], abs=1e-9)
        Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        mixed = solve_hierarchy([levels[0], (Q @ L, Q @ levels[1][1]), levels[2]], -box, box, damping=0.3)
        np.testing.assert_allclose(mixed.qd, damped.qd, rtol=0, atol=1e-8)


def test_configuration():
    for bad in (-1.0, np.nan, np.inf):
        with pytest.raises(ConfigurationError, match="damping"):
            solve_hierarchy([(np.eye(2), np.ones(2))], damping=bad)
    with pytest.raises(ConfigurationError, match="damping"):
        solve_hierarchy([(np.eye(2), np.ones(2))], solver="qpsolvers:daqp", damping=0.1)
