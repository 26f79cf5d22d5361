"""When images come: with a bad tick, late, before anything else, by clocks of any kind, and in any order."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.ranging.configurations import Configurations
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.rules import SensingRules

SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture
def array(eyes: Any) -> RangeSensor:
    """A fixed array that looks at the robot."""
    return RangeSensor.array("array", pose=eyes.looking((0.2, 0.0, 0.6), (1.6, 0.3, 0.9)), sigma=0.005)


def person(distance: float = 0.9) -> np.ndarray:
    """Somebody in the middle of an array's image."""
    read = np.full(64, np.inf)
    read[[27, 28, 35, 36]] = distance
    return read


BAD: dict[str, Callable[[np.ndarray], dict[str, Any]]] = {
    "joints": lambda q: {"q": np.full(6, np.nan)},
    "velocities": lambda q: {"qd": "fast"},
    "both": lambda q: {"distances": [1.0], "points": []},
    "clock": lambda q: {"now": np.nan},
}


@pytest.mark.parametrize("what", BAD)
def test_an_image_that_comes_with_a_bad_tick_is_not_lost(run: Any, array: RangeSensor, what: str) -> None:
    """Nobody sends it twice."""
    loop = run(spots="off", range_sensors=[array])
    loop.feed(loop.q, loop.qd, images=[array.image(np.full(64, np.inf), stamp=0.0)], now=0.0)
    given = {"q": loop.q, "qd": loop.qd, "now": 0.004} | BAD[what](loop.q)
    bad = loop.feed(given.pop("q"), given.pop("qd"), images=[array.image(person(), stamp=0.002)], **given)
    assert bad.status == "bad_input"
    assert len(loop.feed(loop.q, loop.qd, images=[], now=0.008).points) > 0


def test_images_of_a_long_bad_time_are_left_out_and_that_is_said(run: Any, array: RangeSensor) -> None:
    loop = run(spots="off", range_sensors=[array])
    for k in range(150):
        loop.feed(np.full(6, np.nan), loop.qd, images=[array.image(person(), stamp=k * 0.004)], now=k * 0.004)
    tick = loop.feed(loop.q, loop.qd, images=[], now=0.6)
    assert any("left out" in message for message in tick.messages)
    assert len(tick.points) > 0


@settings(max_examples=some(6, of=15))
@given(SEEDS)
def test_images_of_one_tick_may_come_in_any_order(run: Any, eyes: Any, seed: int) -> None:
    """Also those of one sensor, and of sensors that look through what others have lost."""
    rng = np.random.default_rng(seed)
    places = [(1.4, 0.8 * side, 0.9) for side in (-1.0, 1.0)]
    sensors = [
        RangeSensor.array(f"array {i}", pose=eyes.looking((0.3, 0.0, 0.6), place), sigma=0.005)
        for i, place in enumerate(places)
    ]
    images = []
    for sensor in sensors:
        for stamp in np.sort(rng.uniform(-0.19, 0.0, 3)).tolist():
            balls = [(0.75 + stamp, rng.uniform(-0.1, 0.1), 0.7, 0.1)] if rng.random() < 0.6 else []
            images.append(sensor.image(eyes.seen(sensor, sensor.pose, balls), stamp=stamp))
    ticks = []
    for order in (range(6), rng.permutation(6)):
        loop = run(spots="off", range_sensors=sensors)
        ticks.append(loop.feed(loop.q, loop.qd, images=[images[i] for i in order], now=0.0))
        ticks.append(loop.feed(loop.q, loop.qd, images=[], now=0.004))
    assert ticks[:2] == ticks[2:]


@pytest.mark.parametrize("hold", [0.0, 0.15, 0.5])
@pytest.mark.parametrize("age", [0.0, 0.1, 0.19])
def test_what_was_seen_counts_until_it_is_said_that_nothing_is(
    run: Any, array: RangeSensor, hold: float, age: float
) -> None:
    """However old the first image was: no tick is silent, and without anybody, in between."""
    loop = run(spots="off", range_sensors=[array], sensing=SensingRules(hold_time=hold))
    for k in range(120):
        images = [array.image(person(), stamp=-age)] if k == 0 else []
        tick = loop.feed(loop.q, loop.qd, images=images, now=k * 0.004)
        assert len(tick.near) > 0 or tick.unseen == ("array",)
    assert tick.unseen


KINDS: dict[str, Callable[[float], Any]] = {
    "float": float,
    "NumPy": np.float64,
    "of no dimension": np.array,
    "long": np.longdouble,
}


@settings(max_examples=some(4, of=10))
@given(SEEDS, st.sampled_from(sorted(KINDS)), st.sampled_from([0.0, 1e3, -1e3, 2.0**30, 1.7e9]))
def test_only_differences_of_times_count(run: Any, eyes: Any, seed: int, kind: str, start: float) -> None:
    rng, make = np.random.default_rng(seed), KINDS[kind]
    array = RangeSensor.array("array", pose=eyes.looking((0.2, 0.0, 0.6), (1.6, 0.3, 0.9)))
    stamps, reads = rng.integers(1, 30, 8), [person(d) for d in rng.uniform(0.8, 1.1, 8)]
    ticks = []
    for zero, as_given in ((0.0, float), (start, make)):
        loop = run(spots="off", range_sensors=[array])
        for k, (late, read) in enumerate(zip(stamps.tolist(), reads, strict=True)):
            now = zero + k / 64.0  # exact in all of these
            images = [array.image(read, stamp=as_given(now - late / 1024.0))]
            ticks.append(loop.feed(loop.q, loop.qd, images=images, now=as_given(now)))
    half = len(ticks) // 2
    assert ticks[:half] == ticks[half:]


@pytest.mark.parametrize("time", [10**400, "soon", None, True, [1.0], np.array([0.5]), 1j, np.datetime64("now")])
def test_what_is_no_time_is_told_and_the_next_one_counts(run: Any, array: RangeSensor, time: Any) -> None:
    loop = run(spots="off", range_sensors=[array])
    tick = loop.feed(loop.q, loop.qd, images=[array.image(person(), stamp=time), array.image(person(), stamp=0.0)])
    assert len(tick.points) > 0  # the other one
    assert "stamp" in " ".join(tick.messages)
    if time is not None:  # the controller's own
        tick = loop.feed(loop.q, loop.qd, images=[], now=time)
        assert tick.status == "bad_input"
        assert "now" in tick.messages[0]
        assert len(loop.feed(loop.q, loop.qd, images=[], now=0.012).points) > 0


@settings(max_examples=some(10, of=25))
@given(SEEDS, st.sampled_from([1e-4, 0.001, 0.004, 0.1]), st.floats(0.05, 3.0))
def test_a_configuration_is_known_for_as_long_as_images_may_be_old(seed: int, dt: float, span: float) -> None:
    """However short ticks are."""
    rng = np.random.default_rng(seed)
    past = Configurations(1, span)
    now = 0.0
    for k in itertools.count():
        now = k * dt
        past.take(now, np.array([3.0 * now - 1.0]))
        if now > 1.2 * span + 10.0 * dt:
            break
    for time in now - rng.uniform(0.0, span, 20):
        assert past.at(time)[0] == pytest.approx(3.0 * time - 1.0, abs=1e-9)
