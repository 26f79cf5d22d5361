"""Distances and points in centimetres or millimetres are noticed within a second, and metres never are."""

from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sensing.units import FARTHEST_POINT, FARTHEST_READING, UnitWatch

DT = 0.004
SECOND = 251  # ticks in which five looks fall for certain
metres = st.floats(0.15, 8.0) | st.just(np.inf)


@pytest.fixture(scope="module")
def spots(irb140: Any) -> Any:
    return qpsafe.load_spots(irb140)


def controller_of(robot: Any, **options: Any) -> qpsafe.SafetyController:
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    return qpsafe.SafetyController(robot, [qpsafe.PositionTask("tcp", here)], **options)


@settings(max_examples=some(12, of=30))
@given(st.lists(st.lists(metres, min_size=20, max_size=20), min_size=1, max_size=5), st.sampled_from((100.0, 1000.0)))
def test_a_second_in_another_unit_is_noticed_and_metres_are_not(spots: Any, scenes: list, unit: float) -> None:
    """Whatever is seen, however it changes; each spot that sees something is named, and no others."""
    right, wrong = UnitWatch(spots, DT), UnitWatch(spots, DT)
    texts = set()
    for k in range(len(scenes) * SECOND):
        distances = np.array(scenes[k // SECOND])
        assert right.notes(distances, None) == ()
        texts.add(wrong.notes(unit * distances, None))
    constant = np.isfinite(np.array(scenes)).all(axis=0)
    ever = np.isfinite(np.array(scenes)).any(axis=0)
    said = " ".join(texts.pop() if len(texts) == 1 else wrong.notes(unit * np.array(scenes[-1]), None))
    for name, must, may in zip(spots.names, constant, ever, strict=True):
        assert (name in said) >= must
        assert (name in said) <= may or any(name in other for other in spots.names if other != name)
    assert len(texts) <= len(spots) + 1  # it changes only when a spot joins: nothing is flooded


@settings(max_examples=some(12, of=30))
@given(st.lists(st.tuples(*[st.floats(-3.0, 3.0)] * 3), min_size=1, max_size=6), st.data())
def test_points_in_millimetres_are_noticed_and_in_metres_are_not(points: list, data: st.DataObject) -> None:
    array = np.array(points) + np.sign(np.array(points)) * 0.15  # none within 15 cm of the origin
    array[:, 0] += 0.2 * (np.abs(array).max(axis=1) < 0.15)
    far = data.draw(st.floats(1.0, 30.0))
    right, wrong = UnitWatch(None, DT), UnitWatch(None, DT)
    for _ in range(SECOND):
        assert right.notes(None, far * array) == ()
        found = wrong.notes(None, 1000.0 * array)
    assert "centimetres or millimetres" in found[0]


def test_one_reading_in_metres_begins_the_time_anew(spots: Any) -> None:
    watch = UnitWatch(spots, DT)
    for k in range(10 * SECOND):
        near = k % 200 < 60  # a look falls into these
        assert watch.notes(np.full(20, FARTHEST_READING if near else 42.0), None) == ()


def test_points_in_metres_begin_the_time_anew() -> None:
    watch = UnitWatch(None, DT)
    for k in range(10 * SECOND):
        near = k % 200 < 60  # a look falls into these
        assert watch.notes(None, np.full((2, 3), 0.9 if near else 450.0)) == ()


def test_a_range_of_forty_metres_makes_them_healthy(irb140: Any, spots: Any) -> None:
    from dataclasses import replace

    watch = UnitWatch(replace(spots, range_max=np.full(20, 40.0)), DT)
    for _ in range(2 * SECOND):
        assert watch.notes(np.full(20, 42.0), None) == ()


KINDS = {
    "readings": ({"distances": np.full(20, 42.0)}, {}),
    "readings as a list": ({"distances": [420.0] * 20}, {}),
    "one spot of twenty": ({"distances": np.array([*[np.inf] * 19, 42.0])}, {}),
    "points": ({"points": np.full((3, 3), 450.0)}, {}),
    "points as a list": ({"points": [[450.0, 200.0, 500.0]]}, {}),
    "points as distances": ({"distances": np.full((3, 3), 450.0)}, {}),
    "with a barrier": ({"distances": np.full(20, 42.0)}, {"barrier": qpsafe.DangerBarrier(12.0)}),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_tick_says_so_until_acknowledged(irb140: Any, kind: str) -> None:
    given_, options = KINDS[kind]
    controller = controller_of(irb140, **options)
    for _ in range(2):
        ticks = [controller.step(irb140.home, np.zeros(6), **given_) for _ in range(SECOND)]
        assert ticks[0].status == "ok"
        assert ticks[-1].status == "degraded"
        texts = {tick.messages for tick in ticks}
        assert len(texts) == 2  # nothing, then one and the same
        assert "centimetres or millimetres" in ticks[-1].messages[0]
        names = controller.spots.names if "distances" in given_ and np.ndim(given_["distances"]) == 1 else ()
        seen = np.isfinite(np.asarray(given_.get("distances", ()), dtype=float)) if names else ()
        assert ticks[-1].unseen == tuple(name for name, odd in zip(names, seen, strict=True) if odd)
        controller.acknowledge()
    assert FARTHEST_POINT > 50.0
