"""VL53L5CX and VL53L8CX as they are: signal, noise, statuses, whole millimetres, the driver's order of zones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.vl53l5cx import NO_TARGET, Vl53l5cx
from qpsafe.ranging.sensor import RangeImage, RangeSensor

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

WHITE = 0.88  # reflectance of the chart that ranges are stated for
RANGE_VALID, SIGMA_HIGH, SIGNAL_LOW, LARGE_PULSE = 5, 3, 8, 9  # statuses


class Frame(NamedTuple):
    """What the driver's `get_ranging_data` gives with one target a zone, zone by zone (z,)."""

    distance_mm: Numbers
    target_status: Numbers
    range_sigma_mm: Numbers
    nb_target_detected: Numbers


@dataclass(frozen=True)
class Vl53l5cxModel:
    """Figures of the sensor, see `RangingModel`. What the data sheet does not say is chosen by us (*).

    A target's signal goes with its reflectance ρ and 1 / d², so that it is found as far as 4 m √(ρ / 0.88). Farther
    targets read "no target": that is what the sensor says, and why its range is not its promise. Over the last 15 % of
    the way a range is the more often not valid, for want of signal (*). There is one target a zone: the nearest.

    Attributes:
        reflectance: Of everything at 940 nm, 0.17 is grey, 0.88 white (*).
        white: How far white is found [m].
        floor: Standard deviation at no distance [m] (*).
        share: What of the distance is added to it, by squares (*).
        offset: Standard deviation of the offset between units [m] (*).
        gain: Standard deviation of the gain between units (*).
        lost: Probability that a zone has no valid range for another reason (*).
        near: What is nearer saturates, and is told as a large pulse [m].
        latency: Half the exposure of 66 ms, and reading 64 zones on a bus of 1 MHz [s] (*).
        cones: See `RangingModel`.
    """

    reflectance: float = 0.5
    white: float = 4.0
    floor: float = 0.004
    share: float = 0.012
    offset: float = 0.004
    gain: float = 0.01
    lost: float = 0.003
    near: float = 0.02
    latency: float = 0.045
    cones: bool = True

    def __post_init__(self) -> None:
        for key in ("reflectance", "white"):
            if not 0.0 < getattr(self, key) < np.inf:
                raise ConfigurationError("Vl53l5cxModel", key, getattr(self, key), "a finite number > 0")
        for key in ("floor", "share", "offset", "gain", "near", "latency"):
            if not 0.0 <= getattr(self, key) < np.inf:
                raise ConfigurationError("Vl53l5cxModel", key, getattr(self, key), "a finite number >= 0")
        if not 0.0 <= self.lost <= 1.0:
            raise ConfigurationError("Vl53l5cxModel", "lost", self.lost, "a probability")

    def reach(self, sensor: RangeSensor) -> float:
        """How far a target is found [m]."""
        return self.white * float(np.sqrt(self.reflectance / WHITE))

    def sigma(self, distances: Array) -> Array:
        """Standard deviation of a reading at distances [m]."""
        return np.asarray(np.sqrt(self.floor**2 + (self.share * distances) ** 2))

    def unit(self, sensor: RangeSensor, rng: np.random.Generator) -> Vl53l5cxUnit:
        """One sensor, with its own offset and gain."""
        return Vl53l5cxUnit(sensor, self, rng)


class Vl53l5cxUnit:
    """One sensor.

    Args:
        sensor: What it is.
        model: Its kind.
        rng: Of what makes it differ from others.
    """

    def __init__(self, sensor: RangeSensor, model: Vl53l5cxModel, rng: np.random.Generator) -> None:
        self._adapter, self._model, self._sensor = Vl53l5cx(sensor), model, sensor
        offset, gain = np.clip(rng.normal(size=2), -2.5, 2.5)
        self.offset, self.gain = float(model.offset * offset), 1.0 + float(model.gain * gain)

    def frame(self, distances: Array, rng: np.random.Generator) -> Frame:
        """What the driver gives of true distances (z,) [m].

        Args:
            distances: Along the zones' rays.
            rng: Of noise.
        """
        model, (rows, columns) = self._model, self._sensor.shape
        noise, chance = rng.normal(size=len(distances)), rng.random((2, len(distances)))
        reach = model.reach(self._sensor)
        found = distances <= reach
        z = np.where(found, distances, 0.0) * self._sensor.directions[:, 2]  # the sensor tells z, see `Vl53l5cx`
        sigma = model.sigma(z)
        told = self.offset + self.gain * z + sigma * noise
        status = np.where(z < model.near, LARGE_PULSE, RANGE_VALID)
        status[chance[0] < (np.where(found, distances, 0.0) / reach - 0.85) / 0.15] = SIGNAL_LOW
        status[chance[1] < model.lost] = SIGMA_HIGH
        status[~found] = NO_TARGET
        parts = (
            np.where(found, np.clip(np.rint(1e3 * told), 0, 32767), 0),  # the driver cuts off at 0
            status,
            np.where(found, np.rint(1e3 * sigma), 0),
            found,
        )
        turned = np.array(parts, dtype=np.int64).reshape(4, rows, columns)[:, :, ::-1].reshape(4, -1)
        return Frame(*turned)

    def image(self, distances: Array, stamp: float, rng: np.random.Generator) -> RangeImage:
        """An image of true distances, through the driver's frame and `Vl53l5cx`.

        Args:
            distances: Along the zones' rays (z,) [m].
            stamp: When it was taken [s].
            rng: Of noise.
        """
        frame = self.frame(distances, rng)
        return self._adapter.image(
            frame.distance_mm, frame.target_status, stamp=stamp, range_sigma_mm=frame.range_sigma_mm,
            nb_target_detected=frame.nb_target_detected,
        )  # fmt: skip
