"""What the controller is told in a simulation: perfect distances, what Sharp sensors make of them, or all there is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sensing.sharp import SharpConverter
from qpsafe.sim.engine.tracks import people_of
from qpsafe.sim.world.rays import SpotRays
from qpsafe.sim.world.sharp import SharpModel, SharpSensors

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState
    from qpsafe.sensing.skin.spots import SpotArray
    from qpsafe.sim.world.scene import Scene

SENSORS = ("ideal", "sharp", "perfect")


class Sensor(Protocol):
    """Asked once a tick."""

    def read(self, data: Any, state: RobotState) -> NDArray[np.float64]:
        """Distances (k,) or points (p, 3) [m], given the scene's state and the robot in the same configuration."""


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


class PerfectSight:
    """Where everybody is nearest to each link, as points: for robots without sensors, and to compare.

    Args:
        scene: With the robot and the people.
    """

    def __init__(self, scene: Scene) -> None:
        from qpsafe.sim.engine.sight import Sight  # compiled when it is asked for
        from qpsafe.sim.engine.world import World

        self._scene, self._sight = scene, Sight(World.of(scene), scene.robot)

    def read(self, data: Any, state: RobotState) -> NDArray[np.float64]:
        """Points (p, 3) [m]."""
        return self._sight.points(state, people_of(self._scene, data))


def make_sensor(kind: str, scene: Scene, spots: SpotArray | None, seed: int = 0) -> Sensor:
    """The sensor of the given kind.

    Args:
        kind: ``ideal``, ``sharp``, or ``perfect``, which needs no spots.
        scene: What is sensed.
        spots: The distance sensors.
        seed: Of a Sharp sensor's noise and spread.
    """
    if kind == "perfect":
        return PerfectSight(scene)
    if spots is None:
        raise ConfigurationError("FixedExperiment", "sensor", kind, "perfect, for a robot without distance sensors")
    rays = SpotRays(scene, spots)
    if kind == "ideal":
        return IdealSensor(rays)
    if kind == "sharp":
        return SharpSensor(rays, spots, seed=seed)
    raise ConfigurationError("FixedExperiment", "sensor", kind, f"one of {', '.join(SENSORS)}")
