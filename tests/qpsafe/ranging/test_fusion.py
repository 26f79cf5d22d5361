"""A point is looked through where every zone that it may be in reads farther, and nowhere else."""

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.ranging.fusion import LookingThrough
from qpsafe.ranging.sensor import RangeSensor

seeds = st.integers(0, 2**32 - 1)
TOLERANCE, DEVIATIONS = 0.05, 3.0


def scattered(seed: int = 0) -> RangeSensor:
    rng = np.random.default_rng(seed)
    v = rng.normal(size=(150, 3))
    return RangeSensor("scattered", v / np.linalg.norm(v, axis=1, keepdims=True), rng.uniform(0.01, 0.4, 150))


SENSORS = {
    "array": RangeSensor.array("array", range_max=3.0),
    "camera": RangeSensor.camera("camera", (24, 32), (25.0, 25.0, 15.5, 11.5)),
    "scanner": RangeSensor.planar("scanner", -2.0, 0.02, 200, covers=False),
    "scattered": scattered(),
}
TREES = {name: LookingThrough(sensor, TOLERANCE, DEVIATIONS) for name, sensor in SENSORS.items()}


def by_hand(
    sensor: RangeSensor, x: np.ndarray, error: float, d: np.ndarray, valid: np.ndarray, sigma: np.ndarray
) -> bool:
    """All zones, one after the other, by angles."""
    r = float(np.linalg.norm(x))
    if not error < r:
        return False
    off = np.arccos(np.clip(sensor.directions @ x / r, -1.0, 1.0))
    touched = off <= sensor.half_angle + np.arcsin(error / r)
    least = r + error + TOLERANCE + r * np.tan(sensor.half_angle)
    empty = (d > sensor.range_max) & sensor.covers & (least < sensor.range_max)
    through = valid & (d >= 0.0) & np.where(d > sensor.range_max, empty, d - DEVIATIONS * sigma > least)
    return bool(through[touched].all() and (off <= sensor.half_angle).any())


def pose_of(rng: np.random.Generator) -> np.ndarray:
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Q * np.sign(np.linalg.det(Q)), rng.normal(size=3)
    return pose


@settings(max_examples=some(12, of=30), deadline=None)
@given(st.sampled_from(list(SENSORS)), seeds, st.sampled_from([0.0, 0.02, 0.2]))
def test_the_tree_finds_what_all_zones_one_by_one_find(name: str, seed: int, error: float) -> None:
    rng, sensor = np.random.default_rng(seed), SENSORS[name]
    pose, count = pose_of(rng), len(sensor)
    d = rng.choice([0.5, 2.0, 3.5, 50.0, np.inf, np.nan, -1.0], p=[0.04, 0.3, 0.3, 0.2, 0.1, 0.03, 0.03], size=count)
    valid, sigma = rng.uniform(size=count) > 0.02, rng.uniform(0.0, 0.02, count)
    toward = sensor.directions[rng.integers(count, size=60)] + 0.1 * rng.normal(size=(60, 3))
    inside = toward * rng.uniform(0.05, 3.0, (60, 1))
    told = TREES[name](inside @ pose[:3, :3].T + pose[:3, 3], error, pose, d, valid, sigma)
    assert told.tolist() == [by_hand(sensor, x, error, d, valid, sigma) for x in inside]


@settings(max_examples=some(8, of=20), deadline=None)
@given(st.sampled_from(list(SENSORS)), seeds, st.floats(0.0, 0.1), st.floats(0.0, 0.1))
def test_what_may_be_elsewhere_is_looked_through_less(name: str, seed: int, error: float, more: float) -> None:
    """A larger error, noisier readings, or nearer ones never delete a point that was kept without them."""
    rng, sensor, tree = np.random.default_rng(seed), SENSORS[name], TREES[name]
    count, pose = len(sensor), np.eye(4)
    d, valid = rng.uniform(1.0, 3.9, count), np.ones(count, dtype=bool)
    points = sensor.directions[rng.integers(count, size=50)] * rng.uniform(0.2, 2.5, (50, 1))
    few = tree(points, error, pose, d, valid, 0.01)
    assert not (tree(points, error + more, pose, d, valid, 0.01) & ~few).any()
    assert not (tree(points, error, pose, d, valid, 0.01 + more) & ~few).any()
    assert not (tree(points, error, pose, d - more, valid, 0.01) & ~few).any()


@pytest.mark.parametrize("name", SENSORS)
def test_an_image_never_looks_through_what_it_sees(name: str) -> None:
    rng, sensor = np.random.default_rng(1), SENSORS[name]
    d = rng.uniform(0.1, 0.95 * sensor.range_max, len(sensor))
    points = d[:, None] * sensor.directions
    told = TREES[name](points, 0.0, np.eye(4), d, np.ones(len(d), dtype=bool), 0.0)
    assert not told.any()


def test_out_of_sight_is_not_free() -> None:
    """Behind the sensor, beside it, farther than its range, in a zone that tells nothing, and at the sensor itself."""
    sensor, tree = SENSORS["array"], TREES["array"]
    empty, valid = np.full(64, np.inf), np.ones(64, dtype=bool)
    ahead = np.array([[0.01, 0.01, 1.0]])
    assert tree(ahead, 0.0, np.eye(4), empty, valid, 0.0).all()
    for elsewhere in ([0.0, 0.0, -1.0], [2.0, 0.0, 1.0], [0.01, 0.01, 2.98], [0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]):
        assert not tree(np.array([elsewhere]), 0.0, np.eye(4), empty, valid, 0.0).any()
    blind = LookingThrough(RangeSensor.array("blind", covers=False))
    assert not blind(ahead, 0.0, np.eye(4), empty, valid, 0.0).any()
    assert not tree(ahead, 0.0, np.eye(4), empty, ~valid, 0.0).any()
    assert len(sensor) == 64
