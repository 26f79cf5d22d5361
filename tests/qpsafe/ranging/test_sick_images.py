"""Images that cannot be believed: each is reported, none moves the robot beyond its limits, none is taken for free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from amounts import some, thinned
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.ranging.sensor import RangeImage, RangeSensor
from qpsafe.sensing.hulls import Obstacle

DT = 0.004
UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.01], [0.0, 0.0, 0.0, 1.0]])
TABLE = Obstacle.box("table", (1.6, 1.2, 0.1), (0.9, 0.0, -0.15))


@pytest.fixture
def array(eyes: Any) -> RangeSensor:
    """A fixed array that looks down on a table beside the robot."""
    return RangeSensor.array("array", pose=eyes.looking((0.9, 0.0, -0.1), (1.6, 0.3, 1.3)), sigma=0.005)


def table(sensor: RangeSensor) -> np.ndarray:
    """What it reads of the table's plane, and nothing beside it."""
    axes = sensor.directions @ sensor.pose[:3, :3].T
    d = (-0.1 - sensor.pose[2, 3]) / axes[:, 2]
    x, y = (sensor.pose[:3, 3] + d[:, None] * axes)[:, :2].T
    return np.where((abs(x - 0.9) < 0.8) & (abs(y) < 0.6) & (d > 0.0), d, np.inf)


def noisy(read: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The same with noise."""
    return read + 0.003 * rng.normal(size=len(read))


def play(
    run: Callable[..., Any], sensor: RangeSensor, images: Callable[[int], list[Any]], ticks: int, **parts: Any
) -> list[Any]:
    """Ticks of a loop whose sensor gives images(k) at tick k."""
    loop = run(spots="off", range_sensors=[sensor], known=[TABLE], **parts)
    return [loop.feed(loop.q, loop.qd, images=images(k)) for k in range(ticks)]


def every(period: int, make: Callable[[int], Any]) -> Callable[[int], list[Any]]:
    """An image every so many ticks."""
    return lambda k: [make(k)] if k % period == 0 else []


def test_a_healthy_sensor_before_known_things_is_silent(run: Any, array: RangeSensor) -> None:
    rng, read = np.random.default_rng(0), table(array)
    assert 20 <= np.isfinite(read).sum() < 64
    ticks = play(run, array, every(17, lambda k: array.image(noisy(read, rng), stamp=k * DT)), 400)
    assert all(tick.status == "ok" and not tick.unseen and tick.cdf_n == 0.0 for tick in ticks)


SICK: dict[str, tuple[Callable[[RangeSensor, np.ndarray, int, Any], RangeImage], str]] = {
    "all invalid": (lambda s, d, k, _: s.image(d, stamp=k * DT, valid=np.zeros(64, dtype=bool)), "blind"),
    "all NaN": (lambda s, d, k, _: s.image(np.full(64, np.nan), stamp=k * DT), "blind"),
    "one below zero": (lambda s, d, k, _: s.image(np.where(np.arange(64) == 9, -0.1, d), stamp=k * DT), "below zero"),
    "minus infinity": (lambda s, d, k, _: s.image(np.full(64, -np.inf), stamp=k * DT), "below zero"),
    "stale": (lambda s, d, k, _: s.image(d, stamp=k * DT - 0.5), "stale"),
    "from the future": (lambda s, d, k, _: s.image(d, stamp=k * DT + 0.5), "ahead"),
    "stamp not a number": (lambda s, d, k, _: s.image(d, stamp=np.nan), "not finite"),
    "too few zones": (lambda s, d, k, _: s.image(d[:60], stamp=k * DT), "shape"),
    "text": (lambda s, d, k, _: s.image(["far"] * 64, stamp=k * DT), "not an array of real numbers"),
    "sigma not a number": (lambda s, d, k, _: s.image(d, stamp=k * DT, sigma=np.nan), "sigma"),
    "valid no bool": (lambda s, d, k, _: s.image(d, stamp=k * DT, valid=np.ones(64)), "valid"),
    "valid in rows of different lengths": (
        lambda s, d, k, _: s.image(d, stamp=k * DT, valid=[[True], [True, False]]), "valid",
    ),
    "valid masked": (
        lambda s, d, k, _: s.image(d, stamp=k * DT, valid=np.ma.array(np.ones(64, dtype=bool), mask=True)), "masked",
    ),
    "sigma in rows of different lengths": (
        lambda s, d, k, _: s.image(d, stamp=k * DT, sigma=[[0.1], [0.1, 0.2]]), "sigma",
    ),
    "sigma in millimetres": (lambda s, d, k, _: s.image(d, stamp=k * DT, sigma=5.0), "blind"),
    "stamp beyond numbers": (lambda s, d, k, _: s.image(d, stamp=10**400), "not finite"),
    "rows for columns": (lambda s, d, k, _: s.image(d.reshape(4, 16), stamp=k * DT), "shape"),
    "wrong intrinsics": (
        lambda s, d, k, _: RangeSensor.array("array", field_of_view=1.0, pose=s.pose).image(d, stamp=k * DT),
        "zones are others",
    ),
    "of a sensor elsewhere": (
        lambda s, d, k, _: s.placed(UP @ s.pose).image(d, stamp=k * DT),
        "elsewhere",
    ),
    "of a sensor on another frame": (
        lambda s, d, k, _: s.placed(s.pose, "dh3").image(d, stamp=k * DT), "elsewhere",
    ),
    "sees through": (lambda s, d, k, _: s.image(np.full(64, 3.5), stamp=k * DT), "sees through"),
    "nothing where something is": (lambda s, d, k, _: s.image(np.full(64, np.inf), stamp=k * DT), "sees through"),
    "shifted by a row": (lambda s, d, k, _: s.image(np.roll(d, 8), stamp=k * DT), "sees through"),
}  # fmt: skip


@pytest.mark.parametrize("case", thinned(2, SICK))
def test_what_is_sick_is_told_and_its_sensor_is_dead_in_the_end(run: Any, array: RangeSensor, case: str) -> None:
    make, words = SICK[case]
    rng, read = np.random.default_rng(1), table(array)
    healthy, last = 85, 0

    def image(k: int) -> RangeImage:
        return array.image(noisy(read, rng), stamp=k * DT) if k < healthy else make(array, noisy(read, rng), k, rng)

    ticks = play(run, array, every(17, image), 420)
    assert all(tick.status == "ok" for tick in ticks[:healthy])
    told = [tick for tick in ticks[healthy:] if any(words in message for message in tick.messages)]
    assert told, case
    last = ticks[-1]
    # its only sensor: the robot stops, and says so
    assert last.status == "bad_input"
    assert last.severity == "stopped"
    assert last.unseen == ("array",)
    assert not last.reference.qd.any()


@pytest.mark.parametrize("now", [np.nan, np.inf, -np.inf, 0.4, 0.1])
def test_a_clock_that_stands_or_tells_nothing_is_told(run: Any, array: RangeSensor, now: float) -> None:
    """By it no image would ever be stale."""
    rng, read = np.random.default_rng(5), table(array)
    loop = run(spots="off", range_sensors=[array], known=[TABLE])
    for k in range(101):
        images = [array.image(noisy(read, rng), stamp=k * DT)] if k % 17 == 0 else []
        assert loop.feed(loop.q, loop.qd, images=images, now=k * DT).status == "ok"
    tick = loop.feed(loop.q, loop.qd, images=[], now=now)
    assert tick.status == "bad_input"
    assert "now = " in tick.messages[0]


def test_silence_is_told(run: Any, array: RangeSensor) -> None:
    rng, read = np.random.default_rng(2), table(array)
    ticks = play(run, array, lambda k: [array.image(noisy(read, rng), stamp=k * DT)] if k == 0 else [], 120)
    patience = round(array.patience / DT)
    assert all(tick.status == "ok" for tick in ticks[: patience + 1])
    assert all(tick.status == "bad_input" and tick.unseen for tick in ticks[patience + 2 :])
    never = play(run, array, lambda k: [], 120)
    assert "none yet" in " ".join(never[-1].messages)


def test_a_frozen_image_of_a_sensor_that_moves_is_told(irb140: Any, run: Any, eyes: Any) -> None:
    sensor = RangeSensor.array("wrist", mount="dh4", sigma=0.0)
    read = np.where(np.arange(64) < 20, 0.4, np.inf)
    loop = run(spots="off", range_sensors=[sensor])
    said = [
        loop.feed(loop.q, loop.qd, images=[sensor.image(read, stamp=k * DT)] if k % 17 == 0 else []).messages
        for k in range(600)
    ]
    moved = np.linalg.norm(irb140.pose("dh4", loop.q)[:3, 3] - irb140.pose("dh4", irb140.home)[:3, 3])
    assert moved > 0.02  # it evades what it believes to see
    assert any("frozen" in message for messages in said for message in messages)


def test_one_bad_image_among_good_ones_is_told_and_no_more(run: Any, array: RangeSensor) -> None:
    rng, read = np.random.default_rng(3), table(array)

    def image(k: int) -> RangeImage:
        valid = np.zeros(64, dtype=bool) if k == 85 else None
        return array.image(noisy(read, rng), stamp=k * DT, valid=valid)

    ticks = play(run, array, every(17, image), 300)
    assert [k for k, tick in enumerate(ticks) if tick.messages] == [85]
    assert all(tick.severity == "clear" for tick in ticks)


def test_a_dead_sensor_among_many_slows_the_robot_until_acknowledged(run: Any, array: RangeSensor) -> None:
    rng, read = np.random.default_rng(4), table(array)
    sensors = [replace(array, name=f"array {i}") for i in range(6)]
    loop = run(spots="off", range_sensors=sensors, known=[TABLE])

    def tick(k: int, alive: int) -> Any:
        images = [s.image(noisy(read, rng), stamp=k * DT) for s in sensors[:alive]] if k % 17 == 0 else []
        return loop.feed(loop.q, loop.qd, images=images)

    ticks = [tick(k, 6 if k < 100 else 5) for k in range(250)]
    assert ticks[-1].severity == "capped"
    assert ticks[-1].unseen == ("array 5",)
    later = [tick(k, 6) for k in range(250, 300)]
    assert later[-1].severity == "capped"
    assert "dead until acknowledged" in " ".join(later[-1].messages)
    loop.controller.acknowledge()
    assert [tick(k, 6) for k in range(300, 320)][-1].severity == "clear"


@settings(max_examples=some(10, of=60))
@given(st.data())
def test_no_image_whatever_raises_or_leads_beyond_the_limits(run: Any, eyes: Any, data: st.DataObject) -> None:
    numbers = st.floats(allow_nan=True, allow_infinity=True)
    sensor = RangeSensor.array("a", 2, 2, pose=eyes.looking((0.0, 0.0, 0.5), (1.0, 0.2, 0.9)))
    stranger = RangeSensor.array("b", 2, 2)
    thing = st.one_of(
        st.none(), st.text(), numbers, st.lists(numbers, max_size=5),
        st.builds(
            RangeImage,
            st.sampled_from([sensor, stranger, None, "a"]),
            st.one_of(st.lists(numbers, min_size=4, max_size=4), st.lists(numbers, max_size=5), st.none(), st.text()),
            st.one_of(numbers, st.none(), st.text()),
            st.one_of(st.none(), st.lists(st.booleans(), min_size=4, max_size=4), numbers),
            st.one_of(st.none(), numbers, st.lists(numbers, min_size=4, max_size=4)),
        ),
    )  # fmt: skip
    loop = run(spots="off", range_sensors=[sensor])
    for _ in range(data.draw(st.integers(1, 6))):
        images = data.draw(st.one_of(thing, st.lists(thing, max_size=4)))
        now = data.draw(st.one_of(st.none(), numbers))
        loop.feed(loop.q, loop.qd, images=images, now=now)  # `feed` watches limits
