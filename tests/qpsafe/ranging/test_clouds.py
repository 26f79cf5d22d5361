"""Clouds of points given to the tick: reduced to what is nearest to each link, or refused, always said."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest


@pytest.mark.parametrize("count", [1_001, 20_000])
def test_a_cloud_is_as_dangerous_as_its_nearest_points(run: Any, irb140: Any, count: int) -> None:
    rng = np.random.default_rng(count)
    cloud = rng.uniform(-1.0, 1.0, (count, 3)) * 0.4 + np.array([1.2, 0.0, 0.5])
    loop, other = run(spots="off"), run(spots="off")
    tick = loop.step(points=cloud)
    assert any(f"{count} points are reduced" in message for message in tick.messages)
    wire = irb140.wire(loop.controller.robot.home, np.zeros(6))
    # by brute force: the nearest point of every link is among those that count
    for start, end in zip(wire.starts, wire.ends, strict=True):
        axis = end - start
        share = np.clip((cloud - start) @ axis / max(axis @ axis, 1e-300), 0.0, 1.0)
        nearest = cloud[np.argmin(np.linalg.norm(cloud - start - share[:, None] * axis, axis=1))]
        assert np.abs(tick.points - nearest).max(axis=1).min() < 1e-12
    few = other.step(points=tick.points)
    assert few.cdf_n == tick.cdf_n
    assert np.array_equal(few.qd0, tick.qd0)


def test_a_cloud_too_large_for_a_tick_is_refused(run: Any) -> None:
    tick = run(spots="off").step(points=np.full((100_000, 3), 2.0))
    assert tick.status == "bad_input"
    assert "100000 points are given" in tick.messages[0]


def test_a_cloud_with_a_point_that_is_none_is_refused(run: Any) -> None:
    cloud = np.full((5_000, 3), 1.0)
    cloud[4_321, 1] = np.nan
    tick = run(spots="off").step(points=cloud)
    assert tick.status == "bad_input"
    assert "4321" in tick.messages[0]
