"""From readings to the points that count: which link a point belongs to, and how long a lost point still counts."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import qpsafe
from qpsafe.sensing.detection import nearest_link

coordinates = st.floats(-1.0, 1.0)
RULES = partial(qpsafe.SensingRules, approach_speed=0.0, self_detection=False)  # held where it was seen


def distance_to_link(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """By cases: before the start, beyond the end, between them."""
    d = end - start
    if (point - start) @ d <= 0.0:
        return float(np.linalg.norm(point - start))
    if (point - end) @ d >= 0.0:
        return float(np.linalg.norm(point - end))
    return float(np.linalg.norm(np.cross(point - start, d)) / np.linalg.norm(d))


@settings(max_examples=some(10, of=60), deadline=None)
@given(hnp.arrays(np.float64, (4, 3), elements=coordinates), hnp.arrays(np.float64, (6,), elements=coordinates))
def test_no_link_is_nearer_than_the_one_that_is_named(irb140: Any, points: np.ndarray, q: np.ndarray) -> None:
    wire = irb140.wire(q, np.zeros(6))
    for point, link in zip(points, nearest_link(points, wire), strict=True):
        distances = [distance_to_link(point, a, b) for a, b in zip(wire.starts, wire.ends, strict=True)]
        assert distances[link] <= min(distances) + 1e-9
        assert all(d > distances[link] - 1e-9 for d in distances[:link])
        assert all(d > min(distances) for d in distances[:link])  # the first of the nearest


@settings(max_examples=some(10, of=60), deadline=None)
@given(
    hnp.arrays(np.float64, (8, 3), elements=coordinates),
    hnp.arrays(np.float64, (6,), elements=coordinates),
    st.integers(0, 2**32 - 1),
)
def test_rounding_does_not_decide_between_links_that_meet(
    irb140: Any, points: np.ndarray, q: np.ndarray, seed: int
) -> None:
    """Behind an elbow a whole region is nearest to the point that two or three links share."""
    rng = np.random.default_rng(seed)
    wire = irb140.wire(q, np.zeros(6))
    joints = np.vstack((wire.starts, wire.ends))
    points = np.vstack((points, joints[rng.integers(len(joints), size=8)] + 0.3 * rng.normal(size=(8, 3))))
    noisy = wire._replace(
        starts=wire.starts + rng.uniform(-1e-15, 1e-15, wire.starts.shape),
        ends=wire.ends + rng.uniform(-1e-15, 1e-15, wire.ends.shape),
    )
    distances = [
        sorted(distance_to_link(point, a, b) for a, b in zip(wire.starts, wire.ends, strict=True)) for point in points
    ]
    # leave out points that lie half-way between two links by chance, within rounding
    clear = np.array([not 1e-13 < second - first < 1e-8 for first, second, *_ in distances])
    assert np.array_equal(nearest_link(points, wire)[clear], nearest_link(points, noisy)[clear])


def test_a_point_at_the_elbow_belongs_to_the_upper_arm(irb140: Any) -> None:
    """Links 2, 3 (of no length) and 4 meet there; the first of them is named, whatever the pose."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        wire = irb140.wire(rng.uniform(irb140.lower, irb140.upper), np.zeros(6))
        elbow = wire.ends[1:2]
        if distance_to_link(elbow[0], wire.starts[0], wire.ends[0]) > 1e-3:
            assert nearest_link(elbow, wire).tolist() == [1]


def test_no_points_belong_to_no_links(irb140: Any) -> None:
    assert nearest_link(np.zeros((0, 3)), irb140.wire(irb140.home, np.zeros(6))).shape == (0,)


readings = st.lists(
    st.lists(st.sampled_from([np.inf, 0.9, 0.8, 0.52, 0.5, 0.3, 0.26, 0.2]), min_size=20, max_size=20),
    min_size=1,
    max_size=25,
)


@settings(max_examples=some(8, of=20), deadline=None)
@given(readings, st.integers(0, 6))
def test_a_lost_point_counts_for_the_hold_time_and_no_longer(run: Any, series: list[list[float]], ticks: int) -> None:
    """Over any readings: a thing that counts goes on counting, what counts was seen lately, near counts at once.

    The robot stands still: the distance of a counted point from its spot is what counts as its reading.
    """
    loop = run(qpsafe.NullspaceLaw(), limits="off", sensing=RULES(hold_time=ticks * 0.004))
    q, rest = loop.robot.home, np.zeros(6)
    origins, directions = loop.controller.spots.rays(loop.robot.at(q))
    history: list[np.ndarray] = []
    since = np.full(20, 1000)  # ticks since a reading counted as it was read
    for row in series:
        seen = np.where(np.array(row) <= 0.8, row, np.inf)
        history.append(seen)
        tick = loop.controller.step(q, rest, row)
        assert tick.status in ("ok", "degraded")
        counted = np.full(20, np.inf)
        for point in tick.points:  # whose ray is it on, and where
            along = np.einsum("ij,ij->i", point - origins, directions)
            off = np.linalg.norm(point - origins - along[:, None] * directions, axis=1)
            off[along < 0.0] = np.inf  # two spots look in opposite directions on one line
            counted[np.argmin(off)] = along[np.argmin(off)]
            assert off.min() < 1e-6  # directions have 7 digits
        as_read = np.isfinite(seen) & (counted > seen - 1e-6)
        since = np.where(as_read, 0, since + 1)
        assert np.isfinite(counted[since <= ticks]).all()
        assert (counted <= seen + 1e-6).all()  # never farther than it is read now
        older = np.min(history[-2 - 2 * ticks :], axis=0)
        assert (counted >= older - 1e-6).all()  # not nearer than it was lately
        if ticks == 0:
            assert counted == pytest.approx(seen, abs=1e-6)


@pytest.mark.parametrize("hold_time", [0.0, 0.02, 0.3])
def test_a_glimpse_is_remembered_exactly_so_long(run: Any, hold_time: float) -> None:
    loop = run(qpsafe.NullspaceLaw(), sensing=RULES(hold_time=hold_time))
    q, rest = loop.robot.home, np.zeros(6)
    glimpse = np.full(20, np.inf)
    glimpse[3] = 0.4
    dangers = [loop.controller.step(q, rest, glimpse).cdf_n]
    dangers += [loop.controller.step(q, rest, np.full(20, np.inf)).cdf_n for _ in range(100)]
    counted = np.array(dangers) > 0.0
    assert counted.sum() == 1 + round(hold_time / 0.004)
    assert counted[: counted.sum()].all()
