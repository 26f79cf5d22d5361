"""What one sensor sees free, what another sees occupied, and what none of them sees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import first
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.gate.rules import VerifiedMotion
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.rules import SensingRules

DT = 0.004
# the images of these tests do not show the robot
BLIND_TO_ITSELF = SensingRules(self_detection=False)
BALL = (0.75, 0.2, 0.5, 0.12)


@pytest.fixture
def pair(eyes: Any) -> list[RangeSensor]:
    """Two arrays that look at a ball beside the robot from two sides."""
    places = {"left": (0.75, 1.2, 0.6), "front": (1.9, 0.2, 0.6)}
    return [
        RangeSensor.array(name, 16, 16, np.radians(50.0), pose=eyes.looking(BALL[:3], place), sigma=0.005)
        for name, place in places.items()
    ]


def near(tick: Any) -> int:
    """How many places are known on the ball."""
    return int((np.linalg.norm(tick.near - BALL[:3], axis=1) < 0.2).sum())


def test_what_one_sees_free_does_not_delete_what_another_sees(run: Any, eyes: Any, pair: list[RangeSensor]) -> None:
    """The left one sees through the ball, by an error of its own: the front one sees it still, so it is there."""
    loop = run(spots="off", range_sensors=pair, sensing=BLIND_TO_ITSELF)
    for k in range(60):
        images = []
        if k % 10 == 0:
            left, front = (eyes.seen(sensor, sensor.pose, [BALL]) for sensor in pair)
            left = np.full(256, np.inf) if k >= 20 else left
            images = [pair[0].image(left, stamp=k * DT), pair[1].image(front, stamp=k * DT)]
        tick = loop.feed(loop.q, loop.qd, images=images)
    assert near(tick) > 0
    assert tick.cdf_n > 0.0


@pytest.mark.parametrize("free", [True, False])
def test_what_is_lost_is_forgotten_at_once_where_another_looks_through_it(
    run: Any, eyes: Any, pair: list[RangeSensor], free: bool
) -> None:
    """The left one cannot tell any more what is where the ball was; the front one sees that nothing is, or is blind."""
    loop, known = run(spots="off", range_sensors=pair, sensing=BLIND_TO_ITSELF), []
    seen = eyes.seen(pair[0], pair[0].pose, [BALL])
    for k in range(30):
        valid = ~np.isfinite(seen) if k >= 20 else None
        clear = None if free else np.arange(256) == 0
        images = [
            pair[0].image(seen, stamp=k * DT, valid=valid),
            pair[1].image(np.full(256, np.inf), stamp=k * DT, valid=clear),
        ]
        known.append(near(loop.feed(loop.q, loop.qd, images=images)))
    assert known[19] > 0
    assert (known[24] == 0) == free


def test_behind_things_somebody_may_stand_if_that_is_asked_for(run: Any, eyes: Any) -> None:
    camera = RangeSensor.array("camera", 24, 24, np.radians(80.0), pose=eyes.looking((0.4, 0.0, 0.5), (2.4, 0.0, 0.9)))
    board = [(1.2, 0.25 * y, 0.35 + 0.25 * z, 0.2) for y in (-2, -1, 0, 1, 2) for z in (0, 1, 2, 3)]
    found = {}
    for rules in (RangeRules(), RangeRules(unseen="occupied")):
        for name, things in (("nothing", []), ("board", board)):
            loop = run(spots="off", range_sensors=[camera], ranging=rules)
            read = eyes.seen(camera, camera.pose, things)
            tick = loop.feed(loop.q, loop.qd, images=[camera.image(read, stamp=0.0)])
            beyond = tick.near[:, 0] < 0.8 if len(tick.near) else np.zeros(0, dtype=bool)
            found[rules.unseen, name] = int(beyond.sum())
    assert found["free", "nothing"] == found["free", "board"] == 0
    assert found["occupied", "board"] > found["occupied", "nothing"] + 20


@pytest.mark.parametrize(("spots", "arrays"), [(0, 0), (4, 1), (4, 2), (3, 2), (3, 3), (1, 5), (0, 5), (5, 0)])
def test_too_many_that_do_not_see_are_too_many_of_whatever_kind(run: Any, eyes: Any, spots: int, arrays: int) -> None:
    """A fifth of 20 spots and 5 arrays together, and of the spots alone."""
    pose = eyes.looking((0.2, 0.0, 0.6), (1.6, 0.3, 0.9))
    sensors = [RangeSensor.array(f"array {i}", pose=pose) for i in range(5)]
    loop = run(range_sensors=sensors)
    read = np.where(np.arange(20) < spots, np.nan, np.inf)
    for k in range(70):
        images = [s.image(np.full(64, np.inf), stamp=k * 0.004) for s in sensors[arrays:]] if k % 10 == 0 else []
        tick = loop.feed(loop.q, loop.qd, read, images=images)
    assert len(tick.unseen) == spots + arrays
    stops = spots > 4 or spots + arrays > 5
    assert tick.status == ("bad_input" if stops else "degraded" if spots + arrays else "ok")


def test_who_stood_where_nobody_looks_may_have_come_since(run: Any, eyes: Any) -> None:
    """Places are asked for when an image comes, and are as old as that until the next one."""
    camera = RangeSensor.array("camera", 24, 24, np.radians(60.0), pose=eyes.looking((0.4, 0.0, 0.6), (1.6, 0.0, 0.6)))
    read = eyes.seen(camera, camera.pose, [(1.1, 0.1 * y, 0.1 * z, 0.12) for y in range(-4, 5) for z in range(1, 11)])
    loop = run(spots="off", range_sensors=[camera], ranging=RangeRules(unseen="occupied"))
    update, told = loop.controller.ranging.update, []
    loop.controller.ranging.update = lambda *given: told.append(update(*given)) or told[-1]
    for k in range(12):
        loop.feed(loop.q, loop.qd, images=[camera.image(read, stamp=k * DT)] if k % 5 == 0 else [], now=k * DT)
        hidden = len(told[-1].near) - loop.controller.ranging._counts.sum()
        assert hidden > 20
        assert np.allclose(told[-1].leads[-hidden:], (k % 5) * DT)


@pytest.mark.parametrize("first", ["free", "one zone", "no zone", "none"])
def test_a_sensor_that_tells_less_leaves_no_less_occupied(run: Any, irb140: Any, first: str) -> None:
    """One free image, one of a single zone, one that is blind, or none at all; then it is dead, and the robot moves."""
    pose = np.eye(4)
    pose[2, 3] = 0.05
    tool = RangeSensor.array("tool", mount="tcp", pose=pose)
    others = [RangeSensor.array(f"far {i}", pose=eye(3.0 + i, 3.0, 0.0)) for i in range(9)]
    loop = run(spots="off", range_sensors=[tool, *others], ranging=RangeRules(unseen="occupied"))
    valid = {"free": np.ones(64, bool), "one zone": np.arange(64) == 0, "no zone": np.zeros(64, bool)}.get(first)
    for k in range(200):
        images = [sensor.image(np.full(64, np.inf), stamp=k * DT) for sensor in others] if k % 16 == 0 else []
        if valid is not None and k == 0:
            images.append(tool.image(np.full(64, np.inf), stamp=0.0, valid=valid))
        tick = loop.feed(loop.q, loop.qd, images=images, now=k * DT)
        if k >= 150 or first != "free":  # who saw that all was free knows it for a while
            assert len(tick.near) > 10, k


def eye(*place: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = place
    return pose


@settings(max_examples=5)
@given(st.floats(1.7, 6.0), st.lists(st.floats(0.004, 0.29), min_size=1, max_size=3, unique=True))
def test_how_fast_people_come_counts_the_same_whoever_says_it(
    run: Any, eyes: Any, speed: float, times: list[float]
) -> None:
    """What is free may be occupied a while later, by those of the gate as by those of the spots."""
    pose = eyes.looking((0.0, 0.0, 0.6), (2.6, 0.0, 0.6))
    sensor = RangeSensor.array("array", 16, 16, 1.2, pose=pose, period=0.1)
    found = []
    for approach in (1.6, speed):
        loop = run(
            spots="off", range_sensors=[sensor], ranging=RangeRules(unseen="occupied"), gate=VerifiedMotion(speed),
            sensing=SensingRules(approach_speed=approach),
        )  # fmt: skip
        ticks = [loop.feed(loop.q, loop.qd, images=[sensor.image(np.full(256, 3.9), stamp=0.0)], now=0.002)]
        ticks += [loop.feed(loop.q, loop.qd, images=[], now=now) for now in sorted({*times, 0.295})]
        found.append([tick.near.tolist() for tick in ticks])
    assert found[0] == found[1]
    assert len(found[0][-1]) > 0 or speed < 3.0


@pytest.mark.parametrize("speed", first(1, [2.4, 1.6, 0.8]))
def test_who_runs_is_not_forgotten_for_a_look_at_where_a_walker_would_be(run: Any, eyes: Any, speed: float) -> None:
    """One camera has measured the speed and loses him; another one sees free what a walker can reach, no more."""
    period, last, begin = 1 / 15, 6, 0.94 + 6 / 15 * speed
    optics = ((60, 80), (57.0, 57.0, 39.5, 29.5))
    one, two = (
        RangeSensor.camera(name, *optics, pose=eyes.looking(at, place), period=period, max_age=0.8, sigma=0.002)
        for name, place, at in (("one", (0.7, 2.2, 0.9), (0.7, 0.0, 0.7)), ("two", (1.2, -2.5, 1.2), (1.2, 0.0, 0.7)))
    )
    left, known = last * period + 0.2, {}

    def across(camera: RangeSensor) -> np.ndarray:
        """Where each zone's ray meets the plane y = 0 that he runs in [m]."""
        looks = camera.directions @ camera.pose[:3, :3].T
        return camera.pose[0, 3] - camera.pose[1, 3] / looks[:, 1] * looks[:, 0]

    for helped in (False, True):
        loop, k, shown = run(spots="off", range_sensors=[one, two], sensing=BLIND_TO_ITSELF), 0, False
        for j in range(160):
            now, images = DT * (j + 1), []
            if now >= k * period:
                body = (begin - speed * k * period, 0.0, 0.7, 0.04)
                seen = eyes.seen(one, one.pose, [body] if k <= last else [])
                images, k = [one.image(seen, stamp=k * period, valid=across(one) > 0.88)], k + 1
            if helped and not shown and now >= left + DT:
                shown = True
                reach = begin - speed * last * period - 1.6 * 0.2 - 0.08  # where a walker can have got to
                images.append(two.image(np.full(4800, np.inf), stamp=left, valid=across(two) > reach))
            tick = loop.feed(loop.q, loop.qd, images=images, now=now)
            if abs(now - left - 3 * DT) < 1e-9:
                known[helped] = len(tick.near)
    assert known[False] > 0
    assert (known[True] > 0) == (speed > 1.6)
