"""What the controller gets to read in a simulation: perfect distances, or what Sharp sensors make of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sensing.sharp import SharpConverter
from qpsafe.sim.world.rays import SpotRays
from qpsafe.sim.world.sharp import SharpModel, SharpSensors

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState
    from qpsafe.sensing.spots import SpotArray
    from qpsafe.sim.world.scene import Scene

SENSORS = ("ideal", "sharp")


class Sensor(Protocol):
    """Reads all spots once a tick."""

    def read(self, data: Any, state: RobotState) -> NDArray[np.float64]:
        """Distances (k,) [m], given the scene's state and the robot in the same configuration."""


class IdealSensor:
    """The nearest surface in each spot's cone, at once and without noise."""

    def __init__(self, rays: SpotRays) -> None:
        self._rays = rays

    def read(self, data: Any, state: RobotState) -> NDArray[np.float64]:
        """Distances (k,) [m], +inf beyond the range."""
        return self._rays.distances(data, state)


class SharpSensor:
    """Simulated Sharp sensors, and the distances that curves identified from them make of their voltages.

    Args:
        rays: What is really in front of the spots.
        spots: The distance sensors.
        model: Of such a sensor.
        seed: Of the units' differences and of noise.
    """

    def __init__(self, rays: SpotRays, spots: SpotArray, model: SharpModel | None = None, seed: int = 0) -> None:
        self._rays = rays
        calibrated = SharpSensors(len(spots), SharpModel() if model is None else model, seed)
        fits = calibrated.identified(spots.names)
        self.sensors = SharpSensors(len(spots), model, seed)  # the same units, started anew
        self.converter = SharpConverter([fit.curve for fit in fits], spots.range_max)
        self.voltages = np.zeros(len(spots))

    def read(self, data: Any, state: RobotState) -> NDArray[np.float64]:
        """Distances (k,) [m] from this tick's voltages."""
        self.voltages = self.sensors.sample(self._rays.distances(data, state, reach=5.0))
        return self.converter.distances(self.voltages)


def make_sensor(kind: str, scene: Scene, spots: SpotArray, seed: int = 0) -> Sensor:
    """The sensor of the given kind, `ideal` or `sharp`.

    Args:
        kind: ``ideal`` or ``sharp``.
        scene: What is sensed.
        spots: The distance sensors.
        seed: Of a Sharp sensor's noise and spread.
    """
    rays = SpotRays(scene, spots)
    if kind == "ideal":
        return IdealSensor(rays)
    if kind == "sharp":
        return SharpSensor(rays, spots, seed=seed)
    raise ConfigurationError("FixedExperiment", "sensor", kind, f"one of {', '.join(SENSORS)}")
