"""What must not matter: how many zones see a thing, how many sensors, in which order, and where the cell stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.skin.spot_file import read_spots
from qpsafe.tick import Tick

SEEDS = st.integers(0, 2**32 - 1)


def cameras(eyes: Any, rng: np.random.Generator, count: int, size: int = 8) -> list[RangeSensor]:
    """Arrays around the robot that look at it."""
    found = []
    for i in range(count):
        angle = rng.uniform(-np.pi, np.pi)
        place = (1.4 * np.cos(angle), 1.4 * np.sin(angle), rng.uniform(0.3, 1.5))
        pose = eyes.looking((*rng.uniform(-0.2, 0.2, 2), 0.5), place)
        found.append(RangeSensor.array(f"array {i}", size, size, np.radians(60.0), pose=pose, sigma=0.0))
    return found


def balls(rng: np.random.Generator, count: int = 3) -> list[tuple[float, float, float, float]]:
    """People made of balls, beside the robot."""
    angles = rng.uniform(-np.pi, np.pi, count)
    radii = rng.uniform(0.55, 0.9, count)
    return [
        (r * np.cos(a), r * np.sin(a), rng.uniform(0.2, 1.0), 0.12)
        for r, a in zip(radii.tolist(), angles.tolist(), strict=True)
    ]


def first(run: Callable[..., Any], sensors: list[RangeSensor], images: list[Any], **parts: Any) -> Tick:
    """The first tick of a controller that is given images."""
    loop = run(spots="off", range_sensors=sensors, **parts)
    return loop.feed(loop.q, loop.qd, images=images)


def same(a: Tick, b: Tick, within: float = 1e-9) -> None:
    """Whether two ticks say the same."""
    assert a.status == b.status
    assert a.cdf_n == pytest.approx(b.cdf_n, rel=within, abs=within)
    assert np.allclose(a.qd0, b.qd0, rtol=within, atol=within)
    assert np.allclose(a.reference.qd, b.reference.qd, rtol=within, atol=1e-7)


@settings(max_examples=some(5, of=12))
@given(SEEDS)
def test_the_order_of_zones_sensors_and_images_does_not_matter(run: Any, eyes: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    sensors, people = cameras(eyes, rng, 3), balls(rng)
    read = [eyes.seen(sensor, sensor.pose, people) for sensor in sensors]
    straight = first(run, sensors, [s.image(d, stamp=0.0) for s, d in zip(sensors, read, strict=True)])
    order = [rng.permutation(64) for _ in sensors]
    turned = [replace(s, directions=s.directions[p], shape=(0, 0)) for s, p in zip(sensors, order, strict=True)]
    images = [s.image(d[p], stamp=0.0) for s, d, p in zip(turned, read, order, strict=True)]
    same(straight, first(run, turned[::-1], images[1:] + images[:1]))


@settings(max_examples=some(5, of=12))
@given(SEEDS)
def test_the_same_sensor_twice_changes_nothing(run: Any, eyes: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    sensors, people = cameras(eyes, rng, 2), balls(rng)
    more = [*sensors, *(replace(sensor, name=sensor.name + " again") for sensor in sensors)]
    once, twice = (
        first(run, chosen, [s.image(eyes.seen(s, s.pose, people), stamp=0.0) for s in chosen])
        for chosen in (sensors, more)
    )
    same(once, twice)
    assert len(once.points) == len(twice.points)


@settings(max_examples=some(5, of=12))
@given(SEEDS, st.sampled_from([2, 3, 5]))
def test_zones_cut_in_parts_that_read_the_same_change_nothing(run: Any, eyes: Any, seed: int, parts: int) -> None:
    rng = np.random.default_rng(seed)
    (sensor,), people = cameras(eyes, rng, 1), balls(rng)
    read = eyes.seen(sensor, sensor.pose, people)
    cut = replace(
        sensor, directions=np.repeat(sensor.directions, parts, axis=0), half_angle=sensor.half_angle[:1], shape=(0, 0)
    )
    whole = first(run, [sensor], [sensor.image(read, stamp=0.0)])
    same(whole, first(run, [cut], [cut.image(np.repeat(read, parts), stamp=0.0)]))


def test_a_dense_image_is_no_more_danger_than_a_sparse_one(run: Any, eyes: Any) -> None:
    rng = np.random.default_rng(5)
    for _ in range(some(4, of=10)):
        (sparse,), people = cameras(eyes, rng, 1, size=12), balls(rng)
        dense = RangeSensor.array("dense", 96, 96, np.radians(60.0), pose=sparse.pose, sigma=0.0)
        a, b = (
            first(run, [s], [s.image(eyes.seen(s, s.pose, people), stamp=0.0)], ranging=RangeRules(support=1))
            for s in (sparse, dense)
        )
        assert len(b.points) <= 6  # one for each link
        if len(a.points):  # what the sparse one misses may be nearer by the size of its zones
            assert a.cdf_n <= 1.02 * b.cdf_n <= 1.6 * a.cdf_n


@settings(max_examples=some(5, of=12))
@given(SEEDS)
def test_world_and_robot_turned_together_see_the_same(irb140: Any, run: Any, eyes: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    sensors, people = cameras(eyes, rng, 2), balls(rng)
    box = Obstacle.box("floor", (9.0, 9.0, 0.4), (0.0, 0.0, 0.0))  # up to 0.2 m: hides the lower ends of some balls
    angle = rng.uniform(-2.0, 2.0)
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    q = irb140.home + rng.uniform(-0.3, 0.3, 6)
    q[0] = 0.0
    ticks = []
    for T, shift in ((np.eye(4), 0.0), (turn, angle)):
        placed = [sensor.placed(T @ sensor.pose) for sensor in sensors]
        known = [Obstacle("box", box.vertices @ T[:3, :3].T + T[:3, 3])]
        goal = qpsafe.FixedPose(T @ irb140.pose("tcp", q))
        tasks = [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
        rules = SensingRules(self_detection=False)  # the base does not turn with the world
        loop = run(spots="off", range_sensors=placed, known=known, tasks=tasks, sensing=rules)
        moved = q.copy()
        moved[0] = shift
        images = [s.image(eyes.seen(s, s0.pose, people), stamp=0.0) for s, s0 in zip(placed, sensors, strict=True)]
        ticks.append(loop.feed(moved, np.zeros(6), images=images))
    same(*ticks, within=1e-6)


@settings(max_examples=some(5, of=12))
@given(SEEDS)
def test_a_spot_is_a_sensor_of_one_zone(irb140: Any, run: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    spots = qpsafe.load_spots(irb140)
    zones = [RangeSensor.of_spot(spot) for spot in read_spots(irb140.spots_path, irb140)]
    rules = SensingRules(velocities=False, d_min=0.2)
    alone = run(spots=spots, sensing=rules, gate="off")
    ranged = run(
        spots="off", range_sensors=zones, sensing=rules, gate="off",
        ranging=RangeRules(apart=0.01, spread=0.0, deviations=0.0),
    )  # fmt: skip
    read = np.where(rng.random(20) < 0.4, rng.uniform(0.25, 0.75, 20), np.inf)
    for k in range(12):
        a = alone.step(distances=read)
        images = [zone.image([d], stamp=k * 0.004) for zone, d in zip(zones, read.tolist(), strict=True)]
        b = ranged.feed(ranged.q, ranged.qd, images=images)
        assert len(a.points) == len(b.points)
        same(a, b)
        assert np.allclose(a.points[np.lexsort(a.points.T)], b.points[np.lexsort(b.points.T)], atol=1e-12)
