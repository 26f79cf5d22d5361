"""How uncertain a reading is: asked of what reads something, of the surface that a tile shows, and never hiding it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from amounts import crossed
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.ranging.adapters.depth_camera import DepthCamera
from qpsafe.ranging.reduction.reduce_kernel import tile, tile_sigma
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.tick import Tick

SEEDS = st.integers(0, 2**32 - 1)
ONCE = RangeRules(predict=False)


def camera(eyes: Any, rows: int) -> RangeSensor:
    """A camera that looks at the robot, of three pixels across for two down."""
    columns = 3 * rows // 2
    pose, middle = eyes.looking((0.2, 0.0, 0.5), (1.6, 0.0, 0.9)), (0.5 * (columns - 1), 0.5 * (rows - 1))
    return RangeSensor.camera("wall", (rows, columns), (rows, rows, *middle), pose=pose)


def look(run: Callable[..., Any], sensor: RangeSensor, image: Any) -> tuple[Tick, np.ndarray]:
    """The first tick of a controller that is given an image, and since when people near the robot may have come."""
    loop = run(spots="off", range_sensors=[sensor], ranging=ONCE)
    told: list[np.ndarray] = []
    update = loop.controller.ranging.update
    loop.controller.ranging.update = lambda *given: told.append(update(*given)) or told[-1]
    tick = loop.feed(loop.q, loop.qd, images=[image], now=0.0)
    return tick, told[0].leads


@pytest.mark.parametrize("rows", [40, 120])  # as it is, and in tiles
@pytest.mark.parametrize("nothing", [np.inf, 3.9])
def test_what_is_behind_a_person_does_not_change_how_uncertain_the_person_is(
    run: Any, eyes: Any, rows: int, nothing: float
) -> None:
    """Depth that is worse with the square of z is worst where nobody is, and no number where nothing is read."""
    sensor = camera(eyes, rows)
    frames = DepthCamera(sensor, 1.0, sigma_1m=0.01)
    alone, behind = np.full(sensor.shape, np.nan), np.full(sensor.shape, nothing)
    third = slice(rows // 3, 2 * rows // 3)
    alone[third, third] = behind[third, third] = 1.1
    (a, leads_a), (b, leads_b) = (look(run, sensor, frames.image(depth, stamp=0.0)) for depth in (alone, behind))
    assert a.status == b.status == "ok"
    assert np.isfinite(leads_a).all()
    assert np.isfinite(leads_b).all()
    assert len(leads_b)
    assert b.cdf_n > 0.0
    assert np.allclose(a.near, b.near, atol=1e-12)
    assert np.allclose(leads_a, leads_b, atol=1e-12)


@given(SEEDS)
def test_a_tile_is_as_uncertain_as_the_worst_pixel_of_its_surface(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, columns, support = (int(n) for n in rng.integers(1, (12, 12, 5)))
    down, across = int(rng.integers(1, rows + 1)), int(rng.integers(1, columns + 1))
    distances = rng.choice([0.5, 1.0, 1.5, np.inf, np.nan], (rows, columns))
    valid, sigma = rng.random((rows, columns)) < 0.8, rng.random((rows, columns))
    count = down * across
    nearest, known, spread = np.empty(count), np.empty(count, dtype=np.bool_), np.empty(count)
    tile(distances, valid, down, across, support, nearest, known)
    tile_sigma(distances, valid, sigma, down, across, nearest, spread)
    tops, lefts = (np.arange(n + 1) * of // n for n, of in ((down, rows), (across, columns)))
    for i, (y, x) in enumerate(product(range(down), range(across))):
        part = np.s_[tops[y] : tops[y + 1], lefts[x] : lefts[x + 1]]
        read = np.sort(distances[part][valid[part] & ~np.isnan(distances[part])])
        assert known[i] == (len(read) >= support)
        assert nearest[i] == (read[support - 1] if known[i] else np.inf)
        counts = valid[part] & (distances[part] <= nearest[i])
        assert spread[i] == (sigma[part][counts].max() if counts.any() else 0.0)


@given(SEEDS)
def test_less_than_nothing_in_any_pixel_is_less_than_nothing_in_its_tile(seed: int) -> None:
    rng = np.random.default_rng(seed)
    distances, valid = rng.uniform(0.5, 2.0, (9, 9)), rng.random((9, 9)) < 0.7
    y, x = rng.integers(0, 9, 2).tolist()
    distances[y, x], valid[y, x] = rng.choice([-1.0, -np.inf]), True
    nearest, known = np.empty(9), np.empty(9, dtype=np.bool_)
    tile(distances, valid, 3, 3, int(rng.integers(1, 5)), nearest, known)
    assert nearest[3 * (y // 3) + x // 3] < 0.0
    assert known[3 * (y // 3) + x // 3]
    assert (nearest < 0.0).sum() == 1


def test_sigma_is_asked_of_what_reads_something_only(run: Any, eyes: Any) -> None:
    sensor = camera(eyes, 8)
    read = np.where(np.arange(len(sensor)) % 3 == 0, 1.1, np.where(np.arange(len(sensor)) % 3 == 1, np.inf, np.nan))
    told, _ = look(run, sensor, sensor.image(read, stamp=0.0, sigma=0.01 * read))
    plain, _ = look(run, sensor, sensor.image(read, stamp=0.0, sigma=0.011))
    assert told.status == plain.status == "ok"
    assert told.cdf_n == plain.cdf_n > 0.0
    wrong, _ = look(run, sensor, sensor.image(read, stamp=0.0, sigma=np.where(read == 1.1, np.nan, 0.01)))
    assert any("sigma" in message for message in wrong.messages)


@pytest.mark.parametrize(("rows", "sigma"), crossed([8, 120], [20.0, 0.5, 1e6]))
def test_a_sigma_that_hides_everything_near_the_robot_is_told(run: Any, eyes: Any, rows: int, sigma: float) -> None:
    """All would be taken for the robot itself: nothing was said, and nobody was seen."""
    sensor = camera(eyes, rows)
    read = np.full(sensor.shape, 1.1)
    for image in (
        sensor.image(read, stamp=0.0, sigma=sigma),
        sensor.image(read, stamp=0.0, sigma=np.full(sensor.shape, sigma)),
    ):
        tick, _ = look(run, sensor, image)
        assert any("blind" in message for message in tick.messages)
    least = replace(sensor, sigma=min(sigma, 999.0))
    assert any("blind" in message for message in look(run, least, least.image(read, stamp=0.0))[0].messages)
    near = np.where(np.arange(len(sensor)) < len(sensor) // 2, 0.01, 1.1)  # nearer than the range: counts all the same
    tick, _ = look(run, sensor, sensor.image(near, stamp=0.0, sigma=sigma))
    assert tick.status == "ok"
