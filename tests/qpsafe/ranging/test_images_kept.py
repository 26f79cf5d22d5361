"""What a tick keeps is its own: whatever a caller does to its buffers afterwards, the next ticks are the same."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import RangeImage, RangeSensor
from qpsafe.sensing.hulls import Obstacle

SEEDS = st.integers(0, 2**32 - 1)
DT = 0.004

#: What a driver may keep its numbers in.
BUFFERS: tuple[Callable[[np.ndarray], Any], ...] = (
    np.array, list, np.ma.array, lambda a: np.array(a, dtype=np.float32), lambda a: np.array(a)[::-1][::-1],
)  # fmt: skip
#: What goes wrong in a tick, whose images then wait; and nothing.
BAD: tuple[dict[str, Any], ...] = (
    {}, {"q": np.full(6, np.nan)}, {"qd": "fast"}, {"now": np.nan}, {"ages": [1.0]}, {"points": [[np.nan, 0.0, 0.0]]},
)  # fmt: skip


def scribble(thing: Any) -> None:
    """Write into whatever can be written to."""
    if isinstance(thing, list):
        thing[:] = [np.inf] * len(thing)
    elif isinstance(thing, np.ndarray) and thing.flags.writeable:
        thing[...] = True if thing.dtype == bool else np.inf


def person(distance: float) -> np.ndarray:
    """Somebody in the middle of an array's image."""
    read = np.full(64, np.inf)
    read[[27, 28, 35, 36]] = distance
    return read


@pytest.fixture(scope="module")
def arrays(eyes: Any) -> list[RangeSensor]:
    """Two fixed arrays that look at the robot."""
    return [
        RangeSensor.array(f"array {i}", pose=eyes.looking((0.2, 0.0, 0.6), (1.6, y, 0.9)), sigma=0.005)
        for i, y in enumerate((-0.3, 0.3))
    ]


def played(run: Any, sensors: list[RangeSensor], seed: int, spoil: bool) -> list[Any]:
    """Ticks of which some are bad, with more images than are taken at once; `spoil`: the caller reuses its buffers."""
    rng, ticks = np.random.default_rng(seed), []
    budget, unseen = int(rng.choice([1, 400_000])), str(rng.choice(["free", "occupied"]))
    loop = run(range_sensors=sensors, ranging=RangeRules(budget=budget, unseen=unseen))
    for k in range(14):
        images, buffers = [], []
        for sensor in sensors:
            for _ in range(int(rng.integers(0, 3))):
                made = BUFFERS[rng.integers(len(BUFFERS))]
                values = person(rng.uniform(0.8, 1.1)), np.full(64, rng.uniform(0.001, 0.02))
                distances, sigma, valid = made(values[0]), made(values[1]), rng.random(64) < 0.95
                stamp = np.array(k * DT - rng.uniform(0.0, 0.02))
                images.append(sensor.image(distances, stamp=stamp, valid=valid, sigma=sigma))
                buffers += [distances, sigma, valid, stamp]
        spots = rng.uniform(0.3, 0.7, 20) if rng.random() < 0.5 else np.full(20, np.inf)
        data = {"q": loop.q, "qd": loop.qd, "distances": spots, "ages": np.zeros(20), "now": k * DT}
        data |= BAD[max(int(rng.integers(-6, len(BAD))), 0)]
        tick = loop.feed(data.pop("q"), data.pop("qd"), images=images, **data)
        ticks.append((tick.status, tick.messages, tick.cdf_n, tick.near.copy(), tick.points.copy(), tick.qd0.copy()))
        if spoil:
            images.clear()
            for thing in (*buffers, spots, data["ages"], tick.near, tick.points, tick.vectors, tick.qd0):
                scribble(thing)
    return ticks


@settings(max_examples=some(5, of=150))
@given(SEEDS)
def test_a_caller_that_writes_into_its_buffers_changes_no_later_tick(
    run: Any, arrays: list[RangeSensor], seed: int
) -> None:
    kept, reused = (played(run, arrays, seed, spoil) for spoil in (False, True))
    for a, b in zip(kept, reused, strict=True):
        assert a[:2] == b[:2]
        for one, other in zip(a[2:], b[2:], strict=True):
            np.testing.assert_array_equal(one, other)


def test_what_is_written_into_a_tick_is_not_known_afterwards(run: Any, eyes: Any) -> None:
    """Nobody is seen, and many places are where somebody may be."""
    pose = eyes.looking((0.0, 0.0, 0.6), (2.6, 0.0, 0.6))
    sensor = RangeSensor.array("array", 16, 16, 1.2, pose=pose, period=0.1)
    loop = run(spots="off", range_sensors=[sensor], ranging=RangeRules(unseen="occupied"), gate=VerifiedMotion(4.0))
    loop.feed(loop.q, loop.qd, images=[sensor.image(np.full(256, 3.9), stamp=0.0)], now=0.004)
    found = [loop.feed(loop.q, loop.qd, images=[], now=now).near for now in (0.22, 0.224)]
    assert len(found[0]) > 100
    np.testing.assert_array_equal(*found)
    scribble(found[1])
    np.testing.assert_array_equal(loop.feed(loop.q, loop.qd, images=[], now=0.228).near, found[0])


class Stubborn(list[float]):
    """Cannot be copied."""

    def __deepcopy__(self, memo: Any) -> Any:
        raise RuntimeError("no copies")


def test_an_image_that_has_to_wait_and_cannot_be_copied_is_said_to_be_lost(run: Any, arrays: list[RangeSensor]) -> None:
    loop = run(spots="off", range_sensors=arrays)
    image = arrays[0].image(Stubborn(person(0.9)), stamp=0.0)
    assert len(loop.feed(loop.q, loop.qd, images=[image], now=0.002).near) > 0  # none is needed
    later = arrays[0].image(Stubborn(person(0.9)), stamp=0.003)
    assert loop.feed(loop.q, "fast", images=[later], now=0.004).status == "bad_input"
    tick = loop.feed(loop.q, loop.qd, images=[], now=0.008)
    assert any("array 0 that had to wait is lost: RuntimeError: no copies" in message for message in tick.messages)


@settings(max_examples=some(8, of=60))
@given(st.integers(0, 4), st.sampled_from([RuntimeError, ValueError, KeyError, OSError, StopAsyncIteration]))
def test_images_before_one_that_raises_count_and_the_end_is_said(
    run: Any, arrays: list[RangeSensor], count: int, error: type[Exception]
) -> None:
    def images() -> Iterator[RangeImage]:
        for k in range(count):
            yield arrays[k % 2].image(person(0.9), stamp=0.001 * k)
        raise error("boom")

    whole, cut = (run(spots="off", range_sensors=arrays) for _ in range(2))
    first = whole.feed(whole.q, whole.qd, images=list(images_of(images)), now=0.004)
    tick = cut.feed(cut.q, cut.qd, images=images(), now=0.004)
    assert tick.status == "degraded"
    assert any(f"{error.__name__}" in message and "boom" in message for message in tick.messages)
    np.testing.assert_array_equal(tick.near, first.near)
    assert cut.feed(cut.q, cut.qd, images=[], now=0.008).status != "fault"


def images_of(make: Callable[[], Iterator[RangeImage]]) -> Iterator[RangeImage]:
    """What a generator gives before it raises."""
    try:
        yield from make()
    except Exception:
        return


@given(SEEDS)
def test_an_obstacle_keeps_its_vertices(seed: int) -> None:
    given = np.random.default_rng(seed).uniform(-1.0, 1.0, (8, 3))
    for thing in (Obstacle("thing", given), Obstacle("thing", given.tolist())):  # type: ignore[arg-type]
        before = thing.vertices.copy()
        given[:] = 0.0
        np.testing.assert_array_equal(thing.vertices, before)
        with pytest.raises(ValueError, match="read-only"):
            thing.vertices[:] = 0.0
        given[:] = before
    with pytest.raises(ConfigurationError):
        Obstacle("thing", given * np.array([1.0, 1.0, 0.0]))
