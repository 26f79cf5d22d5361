"""Before somebody who stands still, noise of the sensor is no motion, and nothing that is still seen comes nearer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from qpsafe.ranging.sensor import RangeSensor


@pytest.mark.parametrize("seed", range(4))
def test_noise_hardly_moves_the_danger_of_what_stands_still(irb140: Any, run: Any, eyes: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-np.pi, np.pi)
    wall = [(0.85 * np.cos(angle + a), 0.85 * np.sin(angle + a), z, 0.13) for a in (-0.2, 0.0, 0.2) for z in (0.3, 0.6)]
    place = (1.0 * np.cos(angle + 1.2), 1.0 * np.sin(angle + 1.2), 1.2)
    sensor = RangeSensor.array("a", 16, 16, np.radians(70.0), pose=eyes.looking(wall[2][:3], place), sigma=0.02)
    exact = eyes.seen(sensor, sensor.pose, wall)
    found = {}
    for noise in (0.0, 0.01):
        loop = run(spots="off", range_sensors=[sensor])
        danger = []
        for k in range(340):
            images = []
            if k % 17 == 0:
                images = [sensor.image(exact + noise * rng.normal(size=256), stamp=k * 0.004)]
            tick = loop.controller.step(irb140.home, np.zeros(6), images=images)  # held where it is
            danger.append(tick.cdf_n)
        found[noise] = np.array(danger[60:])
    still = found[0.0]
    assert still.max() - still.min() < 1e-9
    assert abs(found[0.01] - still.mean()).max() < 0.12 * still.mean()
