"""What a controller is told in a trial: readings of spots, images of arrays and cameras, or where everybody is."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sensing.sharp import SharpConverter
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.engine.sight import Sight
from qpsafe.sim.engine.spot_rays import SpotReader
from qpsafe.sim.engine.spot_table import SpotTable
from qpsafe.sim.ranging.sets import range_sensors, sensor_kinds
from qpsafe.sim.ranging.zones import ZoneSensors
from qpsafe.sim.world.sharp import SharpModel, SharpSensors

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.sim.engine.tracks import PersonTracks

Array = NDArray[np.float64]

LOOK = 5.0  # how far a Sharp sensor is moved by what it sees [m]
NEAR = 0.8  # how far monitors with perfect sight look: nothing limits their speed farther away [m]
UNITS = 0  # seed of the units: the robot has the same sensors in all trials, noise is each trial's own


class Senses:
    """Readings of one run.

    Args:
        station: With the robot and its spots.
        tracks: Everybody.
        sensor: As for `Plan`; with ``perfect`` nobody asks for readings.
        seed: Of the sensors' noise.
    """

    def __init__(self, station: Station, tracks: PersonTracks, sensor: str, seed: int) -> None:
        self._station, self.tracks = station, tracks
        kinds = sensor_kinds(sensor)
        self._has_spots, sensor = kinds.spots is not None, kinds.spots or "ideal"
        self._zones: ZoneSensors | None = None
        if kinds.ranging:
            sensors, models = range_sensors(kinds.ranging, station.robot)
            self._zones = ZoneSensors(station.scene, station.world, sensors, models, seed=seed, units=UNITS)
        self.spots = spots = station.spots
        reach = LOOK if sensor == "sharp" else None
        self.table = SpotTable.of(station.scene, spots, reach)
        self._reader = SpotReader(station.world, self.table)
        #: Whether all that is told are true distances of spots.
        self.ideal = sensor != "sharp" and not kinds.ranging
        self._sight = Sight(station.world, station.robot)
        self._sharp: SharpSensors | None = None
        if sensor == "sharp":
            self._sharp = SharpSensors(len(spots), SharpModel(), UNITS, noise=seed)
            self._converter = _identified(spots.names, tuple(spots.range_max))

    def distances(self, q: Array, k: int) -> Array:
        """What the spots read at tick k with the robot at q (n,) [rad]; (k,) [m]."""
        poses = self._station.robot.at(q).body_poses()
        found, self._hits = self._reader.read(poses, self.tracks.row(k))
        self._true = found
        if self._sharp is None:
            return found
        return self._converter.distances(self._sharp.sample(found))

    def told(self, q: Array, k: int) -> dict[str, Any]:
        """What a controller that sees by sensors is told at tick k, as `SafetyController.step` takes it.

        Args:
            q: Measured (n,) [rad].
            k: The tick.
        """
        given: dict[str, Any] = {"distances": self.distances(q, k)} if self._has_spots else {}
        if self._zones is not None:
            poses = self._station.robot.at(q).body_poses()
            given |= {"images": self._zones.images(k * DT, poses, self.tracks.row(k)), "now": k * DT}
        return given

    def people_seen(self, q: Array) -> Array:
        """Where the last readings met people (p, 3) [m]; q (n,) as then."""
        met = self._hits >= len(self._station.world.names)
        if not met.any():
            return np.empty((0, 3))
        origins, directions = self.spots.rays(self._station.robot.at(q))
        return np.asarray(origins[met] + self._true[met, None] * directions[met])

    def everywhere(self, q: Array, k: int) -> Array:
        """Where every part of everybody is nearest to each body of the robot at tick k (p, 3) [m], as far as `NEAR`."""
        return self._sight.bodies.to_each(self._station.robot.at(q), self.tracks.row(k), NEAR).on_other

    def nearest(self, q: Array, k: int) -> Array:
        """Where everybody is nearest to each link of the robot at tick k (p, 3) [m], see `Sight`; q (n,) [rad]."""
        return self._sight.points(self._station.robot.at(q), self.tracks.row(k))


@cache
def _identified(names: tuple[str, ...], ranges: tuple[float, ...]) -> SharpConverter:
    """The curves that a calibration of the units finds; the same for all trials."""
    fits = SharpSensors(len(names), SharpModel(), UNITS).identified(names)
    return SharpConverter([fit.curve for fit in fits], np.array(ranges))
