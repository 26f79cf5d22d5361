"""What the noise of Sharp sensors makes of approach velocities: nothing, while a real approach is known."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.sensing.sharp import SharpConverter
from qpsafe.sensing.velocity import STILL
from qpsafe.sim.world.sharp import SharpModel, SharpSensors

ROBOT = qpsafe.load_robot("irb140")
STATE, WIRE = ROBOT.at(ROBOT.home), ROBOT.wire(ROBOT.home, np.zeros(6))


SPOTS = qpsafe.load_spots(ROBOT)
UNITS = 1  # seed


@cache
def converter() -> SharpConverter:
    assert SPOTS is not None
    fits = SharpSensors(len(SPOTS), SharpModel(), UNITS).identified(SPOTS.names)
    return SharpConverter([fit.curve for fit in fits], np.array(SPOTS.range_max))


class Watched:
    """Twenty noisy sensors before something at a distance, and what is made of it."""

    def __init__(self, noise: int) -> None:
        assert SPOTS is not None
        self.sensors = SharpSensors(len(SPOTS), SharpModel(), UNITS, noise=noise)
        self.sensing = DistanceSensing(ROBOT, SPOTS, 0.004)

    def see(self, distance: float) -> Any:
        voltages = self.sensors.sample(np.full(len(self.sensing.spots), distance))
        return self.sensing.update(STATE, WIRE, converter().distances(voltages))


@pytest.mark.parametrize("distance", first(1, [0.75, 0.3, 0.5]))
def test_what_stands_still_does_not_seem_to_come(distance: float) -> None:
    """Once the filters have settled: not of any sensor, in 1.2 s."""
    watched, count = Watched(1), 0
    for k in range(450):
        seen = watched.see(distance)
        if k > 150:
            assert not seen.velocities.any()
            assert np.abs(watched.sensing.memory[-1][:, 2]).max() > 0.0  # there is noise
            count += len(seen.points)
    assert count > 5000


@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_what_comes_is_known_to_come(speed: float) -> None:
    """From 0.2 s after it came into range, but for what may be noise."""
    watched, found = Watched(2), []
    for k in range(round(0.9 / speed / 0.004)):
        distance = 1.1 - speed * 0.004 * k
        seen = watched.see(distance)
        if distance < 0.78 - 0.2 * speed:
            found.append(np.linalg.norm(seen.velocities, axis=1))
    assert np.abs(np.array(found) + STILL - speed).max() < 0.15
