"""Known things out of a sensor's view are left out at once; what an image shows is the same to the last bit as if all
were asked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.ranging.judge import Usable
from qpsafe.ranging.reduction.looking_kernel import COSINE, SINE
from qpsafe.ranging.reduction.reduce import Reducer, view_of
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.body import surrounding_hulls
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules

KINDS = {
    "array": lambda angle, **parts: RangeSensor.array("s", 6, 6, min(angle, 2.8), **parts),
    "scanner": lambda angle, **parts: RangeSensor.planar("s", -0.5 * angle, angle / 40, 41, **parts),
    "zone": lambda angle, **parts: RangeSensor("s", np.array([[0.6, 0.0, 0.8]]), np.array([0.2]), **parts),
}


def reducer(sensor: RangeSensor, robot: Any, things: list[Obstacle]) -> Reducer:
    sensing = SensingRules()
    hulls = surrounding_hulls(robot, sensing.self_detection, things, None)
    return Reducer(sensor, RangeRules(), sensing, hulls, len(robot.wire_frames))


@pytest.mark.parametrize("kind", sorted(KINDS))
@settings(max_examples=some(8, of=40))
@given(st.integers(0, 2**32 - 1))
def test_an_image_shows_the_same_whether_things_out_of_view_are_asked_or_not(irb140: Any, kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    things = [
        Obstacle.box(f"thing {i}", rng.uniform(0.02, 0.6, 3), rng.uniform(-1.5, 1.5, 3))
        for i in range(rng.integers(20))
    ]
    sensor = KINDS[kind](rng.uniform(0.1, 2.0 * np.pi), pose=np.eye(4), range_max=rng.uniform(0.3, 4.0))
    some, every = (reducer(sensor, irb140, things) for _ in range(2))
    every._numbers[[COSINE, SINE]] = -1.0, 0.0  # all around: no ball is outside such a cone
    count = len(sensor)
    for _ in range(12):
        pose = np.eye(4)
        pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        pose[:3, :3] *= np.sign(np.linalg.det(pose[:3, :3]))
        pose[:3, 3] = rng.uniform(-1.2, 1.2, 3)
        state = irb140.at(irb140.home + rng.normal(0.0, 0.5, 6))
        distances = np.where(rng.random(count) < 0.5, rng.uniform(0.0, 4.0, count), np.inf)
        image = Usable(distances, rng.random(count) < 0.9, np.full(count, 0.01), 0.0, sensor.shape)
        given = image, pose, state.body_poses(), state.wire(np.zeros(6)), int(rng.integers(-1, 7))
        (kept, told), (all_kept, all_told) = some(*given), every(*given)
        assert told == all_told
        assert np.array_equal(some.kept[:kept], every.kept[:all_kept])
        assert np.array_equal(some.found[: told.seen], every.found[: told.seen])


@given(st.integers(0, 2**32 - 1), st.integers(1, 50))
def test_all_directions_are_in_the_view(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3)) + rng.normal(0.0, 2.0, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    *middle, cosine, sine = view_of(directions)
    assert np.linalg.norm(middle) == pytest.approx(1.0)
    assert cosine**2 + sine**2 == pytest.approx(1.0)
    assert (directions @ middle >= cosine - 1e-12).all()
