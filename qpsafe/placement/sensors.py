"""What is to be placed: sensors that look along one axis, and arrays of many zones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.placement.objective import SensorName
from qpsafe.ranging.adapters.vl53l5cx import FIELD_OF_VIEW, vl53l5cx
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.rules import SensingRules


class Sensor(NamedTuple):
    """What is to be placed.

    Attributes:
        name: For the file.
        range_min, range_max: A detection counts between these distances [m].
        field_of_view: Full opening angle of a spot's cone, for the file and for what it sees of the robot: people are
            looked for along its axis. Of an array, from edge to edge [rad].
        zones: Rows and columns, as many of each: an array may be turned anyhow about its axis.
        rate: Images a second, of an array, for its file [Hz].
        sigma: Standard deviation of a reading, of an array, for its file [m].
    """

    name: str = "Sharp GP2Y0A02YK"
    range_min: float = 0.20
    range_max: float = 0.80
    field_of_view: float = float(np.deg2rad(6.0))
    zones: tuple[int, int] = (1, 1)
    rate: float = 0.0
    sigma: float = 0.0

    @property
    def is_array(self) -> bool:
        """Whether it has many zones, so that its points act on the link nearest to each, whichever carries it."""
        return self.zones != (1, 1)

    @property
    def directions(self) -> NDArray[np.float64]:
        """Where its zones look, in its own frame, whose z axis is its line of sight, (z, 3)."""
        if not self.is_array:
            return np.array([[0.0, 0.0, 1.0]])
        return RangeSensor.array(self.name, *self.zones, self.field_of_view).directions

    @property
    def opening(self) -> float:
        """Full angle of the cone that holds the axes of all zones, or a spot's cone [rad]."""
        return 2.0 * float(np.arccos(self.directions[:, 2].min())) if self.is_array else self.field_of_view

    @property
    def always(self) -> float:
        """What reads nearer counts as danger, whatever it is [m]."""
        return self.range_min if self.is_array else SensingRules().d_min

    def check(self) -> None:
        """Whether it can be placed.

        Raises:
            ConfigurationError: A range that is none, or an array that is not as high as it is wide.
        """
        if not (0.0 < self.range_min < self.range_max < np.inf):
            found = f"{self.range_min}..{self.range_max}"
            raise ConfigurationError("placement", "sensor", found, "0 < range_min < range_max, finite [m]")
        if self.zones[0] != self.zones[1]:
            raise ConfigurationError("placement", "sensor.zones", self.zones, "as many rows as columns")


def _array_of(sensor: RangeSensor, edge: float) -> Sensor:
    """What of an array is for its placement, and for its file."""
    return Sensor(
        sensor.name, sensor.range_min, sensor.range_max, edge, sensor.shape, round(1.0 / sensor.period, 9), sensor.sigma
    )


#: Figures of the VL53L5CX: see `qpsafe.ranging.adapters.vl53l5cx`.
SENSORS = {
    SensorName.sharp: Sensor(),
    SensorName.vl53l5cx: _array_of(vl53l5cx("VL53L5CX"), FIELD_OF_VIEW),
}
