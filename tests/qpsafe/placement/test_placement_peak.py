"""The largest static field on a person: certified against dense sampling, the field itself, and where it must lie."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.placement.peak import TOLERANCE, peak_field
from qpsafe.robot.wire import Wire

FIELD = qpsafe.DangerField(static=1.0, kinetic=0.0)


def case(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Starts and ends of 6 links, some without length, and capsules that do not touch them."""
    rng = np.random.default_rng(seed)
    joints = np.cumsum(np.vstack((np.zeros(3), rng.normal(scale=0.25, size=(6, 3)))), axis=0)
    joints[3] = joints[2]  # as dh2 and dh3 of the IRB 140
    starts, ends = joints[:-1], joints[1:]
    capsules, radii = [], []
    while len(capsules) < 8:
        a, radius = rng.normal(scale=0.7, size=3), rng.uniform(0.03, 0.15)
        b = a + rng.normal(scale=0.2, size=3)
        line = a + np.linspace(0, 1, 60)[:, None] * (b - a)
        wire = (starts[:, None] + np.linspace(0, 1, 60)[:, None] * (ends - starts)[:, None]).reshape(-1, 3)
        if np.linalg.norm(line[:, None] - wire[None], axis=2).min() > radius + 0.04:
            capsules.append((a, b))
            radii.append(radius)
    return starts, ends, np.array(capsules), np.array(radii)


def at_rest(starts: np.ndarray, ends: np.ndarray) -> Wire:
    return Wire(starts, ends, np.zeros_like(starts), np.zeros_like(starts))


@pytest.mark.parametrize("seed", first(5, range(12)))
def test_no_point_of_the_surface_has_more_than_stated(seed: int) -> None:
    starts, ends, capsules, radii = case(seed)
    (peak,), (place,) = peak_field(starts[None], ends[None], capsules[None], radii)
    wire = at_rest(starts, ends)
    assert FIELD.value(place[None], wire)[0] == pytest.approx(peak, rel=1e-7)
    # the place is on the surface of some capsule
    a, b = capsules[:, 0], capsules[:, 1]
    t = np.clip(((place - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1), 0, 1)
    depth = np.linalg.norm(a + t[:, None] * (b - a) - place, axis=1) - radii
    assert np.abs(depth).min() < 1e-9
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(len(radii), 6000, 3))
    u /= np.linalg.norm(u, axis=2, keepdims=True)
    t = rng.random((len(radii), 6000, 1))
    points = a[:, None] + t * (b - a)[:, None] + radii[:, None, None] * u
    most = FIELD.value(points.reshape(-1, 3), wire).max()
    assert most <= peak * (1.0 + TOLERANCE)
    assert most >= 0.97 * peak  # so that the comparison means something


def test_a_finer_tolerance_changes_no_more_than_the_coarser_one_allows() -> None:
    starts, ends, capsules, radii = (np.stack(parts) for parts in zip(*(case(seed) for seed in range(5)), strict=True))
    coarse, fine = (
        np.array(
            [
                peak_field(s[None], e[None], c[None], r, tol)[0][0]
                for s, e, c, r in zip(starts, ends, capsules, radii, strict=True)
            ]
        )
        for tol in (1e-2, 1e-5)
    )
    assert (coarse <= fine * (1 + 1e-12)).all()
    assert (fine <= coarse * 1.01).all()


def test_a_ball_beside_a_point_robot_has_it_where_it_is_nearest() -> None:
    """One link of no length at the origin: max 1/R is 1/(distance - radius), towards it."""
    zero = np.zeros((1, 1, 3))
    centre, radius = np.array([0.6, 0.3, -0.2]), 0.1
    capsule = np.stack((centre, centre + np.array([0.0, 0.0, 1e-9])))[None, None]
    (peak,), (place,) = peak_field(zero, zero, capsule, np.array([radius]), 1e-6)
    distance = np.linalg.norm(centre)
    assert peak == pytest.approx(1.0 / (distance - radius), rel=2e-6)
    assert place == pytest.approx(centre * (1.0 - radius / distance), abs=2e-3)
