"""Models of sensors: without noise the truth comes back through frame and adapter; with it, what the figures say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.vl53l5cx import vl53l5cx
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sim.ranging.depth_camera_model import DepthCameraModel, edges
from qpsafe.sim.ranging.scanner_model import ScannerModel
from qpsafe.sim.ranging.vl53l5cx_model import Vl53l5cxModel
from qpsafe.sim.ranging.zones import Ideal, ZoneSensors

ARRAY = vl53l5cx("a")
CAMERA = RangeSensor.camera("c", (12, 16), (10.0, 10.0, 7.5, 5.5), range_max=5.0)
SCANNER = RangeSensor.planar("s", -1.0, 0.03, 64, range_min=0.1, range_max=5.0)
QUIET_ARRAY = Vl53l5cxModel(reflectance=0.88, floor=0.0, share=0.0, offset=0.0, gain=0.0, lost=0.0)
QUIET_CAMERA = DepthCameraModel(sigma_1m=0.0, holes=0.0, lost=0.0)
QUIET_SCANNER = ScannerModel(sigma=0.0, lost=0.0)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def distances(count: int):
    """True ones, nothing in sight among them."""
    return arrays(np.float64, count, elements=st.one_of(st.just(np.inf), st.floats(0.0, 6.0)))


@given(distances(64))
def test_an_array_gives_the_truth_back(truth) -> None:
    """To half a millimetre of z; what is beyond 4 m is not found; weak signals are not valid, and not free."""
    image = QUIET_ARRAY.unit(ARRAY, rng()).image(truth, 1.0, rng(1))
    found, valid = np.asarray(image.distances), np.asarray(image.valid)
    inside = truth <= QUIET_ARRAY.reach(ARRAY)
    assert np.array_equal(found == np.inf, ~inside)
    assert (valid | (truth > 0.85 * 4.0)).all()
    assert found[inside & valid] == pytest.approx(truth[inside & valid], abs=0.00051 / ARRAY.directions[:, 2].min())


@given(distances(12 * 16))
def test_a_camera_gives_the_truth_back(truth) -> None:
    """To half a unit of z; what is nearer than 0.2 m is a hole, and nothing is beyond the walls."""
    image = QUIET_CAMERA.unit(CAMERA, rng()).image(truth, 1.0, rng(1))
    ahead = CAMERA.directions[:, 2]
    z = np.minimum(truth * ahead, QUIET_CAMERA.far)
    assert np.array_equal(np.asarray(image.valid), z >= 0.2)
    seen = z >= 0.2
    assert np.asarray(image.distances)[seen] * ahead[seen] == pytest.approx(z[seen], abs=0.00051)


@given(distances(64))
def test_a_scanner_gives_the_truth_back(truth) -> None:
    image = QUIET_SCANNER.unit(SCANNER, rng()).image(truth, 1.0, rng(1))
    expected = np.where(truth < 0.1, 0.0, np.where(truth > 5.0, np.inf, truth))
    assert np.asarray(image.distances) == pytest.approx(expected, abs=1e-6)
    assert np.asarray(image.valid).all()


def errors(model, sensor, distance: float, count: int = 300):
    """Errors of readings at a distance, along z, of one unit, and the deviation it tells."""
    unit, noise = model.unit(sensor, rng(5)), rng(6)
    images = [unit.image(distance / sensor.directions[:, 2], 0.0, noise) for _ in range(count)]
    z = np.array([image.distances for image in images]) * sensor.directions[:, 2]
    told = np.nan if images[0].sigma is None else np.asarray(images[0].sigma) * sensor.directions[:, 2]
    return z - distance, told


def test_an_arrays_noise_is_what_it_says_of_itself() -> None:
    model = replace(QUIET_ARRAY, floor=0.004, share=0.012)
    for distance in (0.2, 1.0, 3.0):
        off, told = errors(model, ARRAY, distance)
        assert np.nanstd(off) == pytest.approx(model.sigma(np.array(distance)), rel=0.03)
        assert np.nanmean(off) == pytest.approx(0.0, abs=0.001)
        assert np.nanmedian(told) == pytest.approx(model.sigma(np.array(distance)), abs=0.0005)


def test_a_cameras_noise_grows_with_the_square_of_z() -> None:
    model = replace(QUIET_CAMERA, sigma_1m=0.004)
    for distance in (0.5, 1.0, 3.0):
        off, told = errors(model, CAMERA, distance)
        assert np.nanstd(off) == pytest.approx(0.004 * distance**2, rel=0.05)
        assert np.nanmedian(told) == pytest.approx(0.004 * distance**2, rel=0.05)


def test_a_scanners_noise() -> None:
    unit, noise = ScannerModel(sigma=0.02, lost=0.1).unit(SCANNER, rng()), rng(6)
    found = np.array([unit.image(np.full(64, 1.0), 0.0, noise).distances for _ in range(200)])
    assert np.nanstd(found) == pytest.approx(0.02, rel=0.03)
    assert np.isnan(found).mean() == pytest.approx(0.1, rel=0.1)


def test_dark_things_are_found_less_far_and_read_no_target() -> None:
    """17 % reflects a signal of 88 % at 2.27 times the distance."""
    dark = replace(QUIET_ARRAY, reflectance=0.17)
    assert dark.reach(ARRAY) == pytest.approx(4.0 * np.sqrt(0.17 / 0.88))
    for model, free in ((dark, True), (QUIET_ARRAY, False)):
        image = model.unit(ARRAY, rng()).image(np.full(64, 2.5), 0.0, rng())
        assert np.asarray(image.valid).all()
        assert (np.asarray(image.distances) == np.inf).all() == free


def test_what_is_too_near_is_near() -> None:
    image = Vl53l5cxModel(lost=0.0).unit(ARRAY, rng()).image(np.full(64, 0.005), 0.0, rng())
    assert np.asarray(image.valid).all()
    assert (np.asarray(image.distances) < 0.04).all()


def test_units_differ_and_are_the_same_ones_with_the_same_seed() -> None:
    model = Vl53l5cxModel()
    units = [model.unit(ARRAY, rng(seed)) for seed in (1, 1, 2)]
    assert (units[0].offset, units[0].gain) == (units[1].offset, units[1].gain)
    assert units[0].gain != units[2].gain


def test_holes_lie_at_edges() -> None:
    """A person-like block before a wall: no hole anywhere else, on both sides of its edge some."""
    z = np.full((12, 16), 3.0)
    z[3:9, 5:11] = 1.0
    model, ahead = replace(DepthCameraModel(), lost=0.0), CAMERA.directions[:, 2]
    frames = np.array([model.unit(CAMERA, rng()).frame(z.ravel() / ahead, rng(i)) for i in range(100)])
    share = (frames == 0).mean(axis=0)
    edge = np.zeros((12, 16), dtype=bool)
    edge[2:10, 5:11] = edge[3:9, 4:12] = True
    edge[4:8, 6:10] = False
    assert (share[~edge] == 0.0).all()
    assert share[edge] == pytest.approx(0.5, abs=0.2)


@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(0.5, 3.0))
def test_a_plane_has_no_edges_however_it_is_inclined(across, down, ahead) -> None:
    """z = ahead / (1 - across x - down y) of the pixels' (x, y, 1)."""
    x, y = (CAMERA.directions[:, i] / CAMERA.directions[:, 2] for i in (0, 1))
    z = ahead / (1.0 - across * x - down * y)
    assert z.min() > 0.0
    assert not edges(z.reshape(12, 16), 0.05).any()


def test_runs_repeat_and_noise_is_of_the_seed(worlds, stage) -> None:
    _, scene, world = stage
    _, state, tracks = next(iter(worlds.random_encounters(scene, 1, 7)))
    sensor, poses, people = vl53l5cx("a", mount="dh3"), world.poses(state), tracks.row(0)

    def run(seed: int, units: int = 0, ticks=range(60)):
        sensors = ZoneSensors(scene, world, [sensor], Vl53l5cxModel(reflectance=0.88), seed=seed, units=units)
        return [np.asarray(i.distances) for k in ticks for i in sensors.images(0.004 * k, poses, people)]

    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(run(1), run(1), strict=True))
    assert not np.array_equal(run(1)[0], run(2)[0], equal_nan=True)
    assert not np.array_equal(run(1)[0], run(1, units=1)[0], equal_nan=True)


MISTAKES = [
    (Vl53l5cxModel, {"reflectance": 0.0}), (Vl53l5cxModel, {"lost": 1.5}), (Vl53l5cxModel, {"floor": np.nan}),
    (DepthCameraModel, {"scale": 0.0}), (DepthCameraModel, {"holes": -0.1}), (DepthCameraModel, {"near": np.inf}),
    (ScannerModel, {"sigma": -1.0}), (ScannerModel, {"lost": np.nan}),
]  # fmt: skip


@pytest.mark.parametrize(("model", "figure"), MISTAKES)
def test_mistakes_are_named(model, figure) -> None:
    with pytest.raises(ConfigurationError, match=next(iter(figure))):
        model(**figure)


def test_ideal_units_say_the_truth() -> None:
    image = Ideal().unit(ARRAY, rng()).image(np.arange(64.0), 2.0, rng())
    assert np.array_equal(image.distances, np.arange(64.0))
    assert image.stamp == 2.0
