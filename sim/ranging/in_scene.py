"""The range sensors of an experiment in MuJoCo: asked once a tick, as its spots are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.sensor import RangeImage
from qpsafe.sim.engine.tracks import people_of
from qpsafe.sim.engine.world import World
from qpsafe.sim.ranging.sets import range_sensors
from qpsafe.sim.ranging.zones import ZoneSensors

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState
    from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]


class SceneRanging:
    """Range sensors in a scene.

    Args:
        scene: The scene.
        kinds: Of `qpsafe.sim.ranging.sets.RANGING`.
        seed: Of the units' differences and of noise.

    Attributes:
        names: Of the sensors (r,).
        nearest: The smallest valid distance in the last image of each (r,) [m]; +inf where nothing is in range.
    """

    def __init__(self, scene: Scene, kinds: tuple[str, ...], seed: int = 0) -> None:
        sensors, models = range_sensors(kinds, scene.robot)
        self._scene, self._world = scene, World.of(scene, movable=True)
        self._sensors = ZoneSensors(scene, self._world, sensors, models, seed=seed, units=seed)
        self.names = tuple(sensor.name for sensor in sensors)
        self.nearest = np.full(len(sensors), np.inf)

    def images(self, time: float, data: Any, state: RobotState) -> list[RangeImage]:
        """Those that have come since the last tick.

        Args:
            time: Of this tick [s].
            data: State of the scene, geom poses of people and what can move up to date.
            state: The robot now.
        """
        found = self._sensors.images(time, self._world.poses(state, data), people_of(self._scene, data))
        for image in found:
            sensor = image.sensor
            seen = np.where(image.distances <= sensor.range_max, image.distances, np.inf)  # type: ignore[operator]
            self.nearest[self.names.index(sensor.name)] = seen.min()
        return found
