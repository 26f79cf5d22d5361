"""The derivative of the kinetic field by the links' velocities: Euler's theorem, differences, hard places."""

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.kinetic import velocity_gradient
from qpsafe.robot.wire import Wire

FIELD = qpsafe.DangerField(static=0.7, kinetic=1.3, gamma=1.7)
STILL = np.zeros((1, 3))
seeds = st.integers(0, 100_000)


def gradient(points: np.ndarray, wire: Wire) -> np.ndarray:
    out = np.empty((len(points), len(wire.starts), 2, 3))
    velocity_gradient(points, *wire, FIELD.kinetic, FIELD.gamma, FIELD.floor, out)
    return out


def kinetic(points: np.ndarray, wire: Wire) -> np.ndarray:
    still = Wire(wire.starts, wire.ends, 0.0 * wire.starts, 0.0 * wire.starts)
    return FIELD.value(points, wire) - FIELD.value(points, still)


def link(seed: int, length: float, turn: float, away: float) -> tuple[np.ndarray, Wire]:
    """A link of some length, its velocity turned against the other end's, points at some distances."""
    if length < 1e-3 * away:  # both ends of what is nearly a point move alike
        turn = min(turn, 1e-3)
    rng = np.random.default_rng(seed)
    start, way = rng.normal(size=(2, 3))
    v0, other = rng.normal(size=(2, 3))
    v1 = (1.0 - turn) * rng.uniform(0.5, 1.5) * v0 + turn * other
    if turn > 1.0:  # through zero somewhere on the link
        v1 = -rng.uniform(0.2, 3.0) * v0
    end = start + length * way / np.linalg.norm(way)
    side = rng.normal(size=(5, 3))
    side /= np.linalg.norm(side, axis=1)[:, None]
    points = start + rng.uniform(0.0, 1.0, (5, 1)) * (end - start) + away * side
    return points, Wire(start[None], end[None], v0[None], v1[None])


lengths = st.sampled_from([0.0, 1e-7, 1e-4, 1e-2, 0.3, 1.0])
turns = st.sampled_from([0.0, 1e-9, 1e-3, 0.5, 1.0, 2.0])
distances = st.sampled_from([2e-3, 0.05, 0.4, 3.0])


@settings(max_examples=some(25, of=150), deadline=None)
@given(seeds, lengths, turns, distances)
def test_eulers_theorem(seed: int, length: float, turn: float, away: float) -> None:
    """H is homogeneous of degree 1 in the velocities: ∂H/∂v·v = H."""
    points, wire = link(seed, length, turn, away)
    g = gradient(points, wire)
    product = g[:, 0, 0] @ wire.start_velocities[0] + g[:, 0, 1] @ wire.end_velocities[0]
    scale = FIELD.kinetic * np.abs(g).max() * max(np.abs(v).max() for v in wire[2:])
    assert product == pytest.approx(kinetic(points, wire), rel=1e-8, abs=1e-8 * scale)


@settings(max_examples=some(10, of=60), deadline=None)
@given(seeds, st.sampled_from([0.03, 0.3, 1.0]), st.sampled_from([0.0, 1e-3, 0.5, 1.0, 2.0]), distances)
def test_differences(seed: int, length: float, turn: float, away: float) -> None:
    points, wire = link(seed, length, turn, away)
    g, h = gradient(points, wire), 1e-5
    for side in (0, 1):
        for c in range(3):
            values = []
            for s in (h, -h):
                parts = [part.copy() for part in wire]
                parts[2 + side][0, c] += s
                values.append(FIELD.value(points, Wire(*parts)))
            difference = (values[0] - values[1]) / (2.0 * h)
            assert g[:, 0, side, c] == pytest.approx(difference, rel=1e-4, abs=1e-4 * np.abs(g).max())


def test_a_link_at_rest_is_pushed_by_its_linear_part_only() -> None:
    """|v| has a kink at 0: the middle of its derivatives there is 0; v·w/R³ is linear and has one."""
    points, wire = link(3, 0.5, 0.5, 0.3)
    still = Wire(wire.starts, wire.ends, STILL, STILL)
    g, h = gradient(points, still), 1e-6
    for side in (0, 1):
        for c in range(3):
            values = []
            for s in (h, -h):
                parts = [part.copy() for part in still]
                parts[2 + side][0, c] += s
                values.append(FIELD.value(points, Wire(*parts)))
            assert g[:, 0, side, c] == pytest.approx((values[0] - values[1]) / (2 * h), abs=1e-6)


def test_what_is_not_finite_is_nan() -> None:
    points, wire = link(4, 0.5, 0.5, 0.3)
    points[0, 1], points[1, 0] = np.nan, np.inf
    g = gradient(points, wire)
    assert np.isnan(g[:2]).all()
    assert np.isfinite(g[2:]).all()
