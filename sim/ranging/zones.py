"""What the zones of range sensors meet, when each of them looks, and the images that have arrived by a tick.

A zone is looked into as a spot is, `qpsafe.sim.engine.spot_rays`: along its axis and along rays on its cone's mantle,
or along the axis alone where a model says that its pixels are narrow. A sensor does not see the body that it is fixed
to; one that is fixed to the world sees everything. The world's frame is the robot's base, on top of the pedestal.

A model makes a frame of what was met in the form of the real thing and has it read by the same adapter that reads the
real thing's, so that both are tried at every image.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import WORLD, RangeImage, RangeSensor
from qpsafe.sim.engine.spot_rays import SpotReader
from qpsafe.sim.engine.spot_table import SpotTable, scene_body

if TYPE_CHECKING:
    from qpsafe.sim.engine.world import World
    from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]

EARLY = 1e-9  # by which a time may lie before a tick and still belong to it [s]


class Unit(Protocol):
    """One sensor of a model, with whatever makes it differ from others of its kind."""

    def image(self, distances: Array, stamp: float, rng: np.random.Generator) -> RangeImage:
        """An image of true distances.

        Args:
            distances: Along the zones' rays, (z,), +inf where nothing is [m].
            stamp: When it was taken [s].
            rng: Of noise.
        """


class RangingModel(Protocol):
    """What a kind of sensor does to what its zones meet.

    Attributes:
        latency: From the moment that an image is of until it can be read [s].
        cones: Whether a zone is looked into along its whole cone, or along its axis.
    """

    @property
    def latency(self) -> float:
        """See the class."""

    @property
    def cones(self) -> bool:
        """See the class."""

    def reach(self, sensor: RangeSensor) -> float:
        """What is farther changes nothing [m]."""

    def unit(self, sensor: RangeSensor, rng: np.random.Generator) -> Unit:
        """One of them; `rng` is of the spread between units."""


@dataclass(frozen=True)
class Ideal:
    """True distances, at once; see `RangingModel`."""

    latency: float = 0.0
    cones: bool = True

    def reach(self, sensor: RangeSensor) -> float:
        """As far as the sensor looks."""
        return sensor.range_max

    def unit(self, sensor: RangeSensor, rng: np.random.Generator) -> Unit:
        """They are all alike."""
        return _IdealUnit(sensor)


class _IdealUnit:
    def __init__(self, sensor: RangeSensor) -> None:
        self._sensor = sensor

    def image(self, distances: Array, stamp: float, rng: np.random.Generator) -> RangeImage:
        return RangeImage(self._sensor, distances, stamp)


def zone_table(scene: Scene, sensor: RangeSensor, reach: float, cones: bool = True) -> SpotTable:
    """The zones of a sensor as spots, for `qpsafe.sim.engine.spot_rays.read_spots`.

    Args:
        scene: With the robot.
        sensor: On it, or in the world.
        reach: What is farther is not met [m].
        cones: Whether a zone is its cone, or its axis.
    """
    count = len(sensor)
    body, place = (0, np.eye(4)) if sensor.mount == WORLD else scene.robot.mounting(sensor.mount)
    unseen = -1 if sensor.mount == WORLD else scene_body(scene, sensor.mount)
    T = place @ sensor.pose
    rays = np.zeros((count, 4, 2))
    rays[:, :, 0], rays[:, :3, 1] = T[:, 3], sensor.directions @ T[:3, :3].T
    slants = np.tan(sensor.half_angle) if cones else np.zeros(count)
    return SpotTable(
        np.full(count, body, dtype=np.int64), np.full(count, unseen, dtype=np.int64), rays, np.full(count, reach),
        slants,
    )  # fmt: skip


class ZoneSensors:
    """The range sensors of a simulation.

    Each looks once in its period; within it they look one after another, evenly. At the first call every sensor has an
    image, as if all had stood still before. A sensor looks at the first tick at which it is due, so that stamps are
    times of ticks; its image comes when its model's latency has passed. Noise of a sensor depends on the seed, its
    number and how many images it has made, not on when it is asked.

    Args:
        scene: With the robot.
        world: The same, flat; with `movable` scenery or without.
        sensors: On the robot or in the world.
        models: Of all sensors, or one each; `Ideal` by default.
        seed: Of noise.
        units: Of the spread between units: equal ones are the same sensors.

    Raises:
        ConfigurationError: A sensor is not the robot's, two have the same name, or there are more or fewer models.
    """

    def __init__(
        self,
        scene: Scene,
        world: World,
        sensors: Sequence[RangeSensor],
        models: RangingModel | Sequence[RangingModel] | None = None,
        *,
        seed: int = 0,
        units: int = 0,
    ) -> None:
        each = list(models) if isinstance(models, Sequence) else [Ideal() if models is None else models] * len(sensors)
        if len(each) != len(sensors):
            raise ConfigurationError("ZoneSensors", "models", len(each), f"one, or one for each of {len(sensors)}")
        names = [sensor.name for sensor in sensors]
        if len(set(names)) < len(names):
            raise ConfigurationError("ZoneSensors", "sensors", names, "names of their own")
        self.sensors, self._looks = tuple(sensors), []
        for i, (sensor, model) in enumerate(zip(sensors, each, strict=True)):
            sensor.check(scene.robot)
            reader = SpotReader(world, zone_table(scene, sensor, model.reach(sensor), model.cones))
            unit = model.unit(sensor, np.random.default_rng((units, 0, i)))
            share = (i + 1) / len(sensors)  # of a period until it looks again
            self._looks.append(_Look(reader, unit, model.latency, sensor.period, share, (seed, 1, i)))

    def images(self, time: float, poses: Array, people: tuple[Array, ...]) -> list[RangeImage]:
        """Those that have come since the last call, in the order in which they were taken.

        Args:
            time: Now, of a clock that only goes on [s].
            poses: Of the world's bodies now, (b, 4, 4) [m], see `World.poses`.
            people: A row of `PersonTracks`, now.
        """
        came = [image for look in self._looks for image in look.at(time, poses, people)]
        came.sort(key=lambda image: image.stamp)
        return came


class _Look:
    """When one sensor looks, and what of it is on its way."""

    def __init__(
        self, reader: SpotReader, unit: Unit, latency: float, period: float, share: float, seed: tuple[int, ...]
    ) -> None:
        self._reader, self._unit, self._latency, self._period = reader, unit, latency, period
        self._share, self._rng = share, np.random.default_rng(seed)
        self._due: float | None = None
        self._coming: deque[tuple[float, RangeImage]] = deque()

    def at(self, time: float, poses: Array, people: tuple[Array, ...]) -> list[RangeImage]:
        """What has arrived by now."""
        if self._due is None:
            self._due = time + self._share * self._period
            self._coming.append((time, self._take(poses, people, time - self._latency)))
        elif time >= self._due - EARLY:
            # what was missed between two far calls is missed
            self._due += self._period * (1 + int((time + EARLY - self._due) / self._period))
            self._coming.append((time + self._latency, self._take(poses, people, time)))
        came = []
        while self._coming and self._coming[0][0] <= time + EARLY:
            came.append(self._coming.popleft()[1])
        return came

    def _take(self, poses: Array, people: tuple[Array, ...], stamp: float) -> RangeImage:
        return self._unit.image(self._reader.read(poses, people)[0], stamp, self._rng)
