"""A stereo depth camera as it is: noise by z², holes at edges and near by, whole units of depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.depth_camera import DepthCamera
from qpsafe.ranging.sensor import RangeImage, RangeSensor

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DepthCameraModel:
    """Figures of a camera like the RealSense D435, see `RangingModel`. What is chosen by us is marked (*).

    Pixels are looked along, not into: a pixel of 640x480 is narrow. A simulation takes fewer of them, 80x60 say, that
    is every eighth one of every eighth row; full frames are 9.2 million rays a second.

    Attributes:
        sigma_1m: Standard deviation of z at 1 m, σ_d / (f b): 0.08 pixels of disparity, f = 385 pixels at 640x480,
            b = 50 mm [m].
        scale: Of a unit of depth [m].
        near: What is nearer is not seen, and reads 0 [m].
        far: Where the walls are that everything else is before [m] (*).
        edge: A step in z between two neighbours, beyond what a plane would have there, that is an edge [m] (*).
        holes: Probability that a pixel at an edge reads 0 (*).
        lost: Probability that any pixel does (*).
        latency: From exposure until the frame is there [s] (*).
        cones: See `RangingModel`.
    """

    sigma_1m: float = 0.0042
    scale: float = 0.001
    near: float = 0.2
    far: float = 8.0
    edge: float = 0.1
    holes: float = 0.5
    lost: float = 0.002
    latency: float = 0.05
    cones: bool = False

    def __post_init__(self) -> None:
        for key in ("scale", "far", "edge"):
            if not 0.0 < getattr(self, key) < np.inf:
                raise ConfigurationError("DepthCameraModel", key, getattr(self, key), "a finite number > 0")
        for key in ("sigma_1m", "near", "latency"):
            if not 0.0 <= getattr(self, key) < np.inf:
                raise ConfigurationError("DepthCameraModel", key, getattr(self, key), "a finite number >= 0")
        for key in ("holes", "lost"):
            if not 0.0 <= getattr(self, key) <= 1.0:
                raise ConfigurationError("DepthCameraModel", key, getattr(self, key), "a probability")

    def reach(self, sensor: RangeSensor) -> float:
        """As far as the walls, along the most inclined ray [m]."""
        return self.far / float(sensor.directions[:, 2].min())

    def unit(self, sensor: RangeSensor, rng: np.random.Generator) -> DepthCameraUnit:
        """One camera; they are alike."""
        return DepthCameraUnit(sensor, self)


class DepthCameraUnit:
    """One camera.

    Args:
        sensor: What it is.
        model: Its kind.
    """

    def __init__(self, sensor: RangeSensor, model: DepthCameraModel) -> None:
        self._adapter, self._model, self._sensor = DepthCamera(sensor, model.scale, model.sigma_1m), model, sensor

    def frame(self, distances: Array, rng: np.random.Generator) -> NDArray[np.uint16]:
        """Depth (rows, columns) in units, 0 for holes, of true distances (z,) [m].

        Args:
            distances: Along the pixels' rays.
            rng: Of noise.
        """
        model, shape = self._model, self._sensor.shape
        z = np.minimum(distances * self._sensor.directions[:, 2], model.far).reshape(shape)
        jump, chance = edges(z, model.edge), rng.random(shape)
        hole = (z < model.near) | (jump & (chance < model.holes)) | (chance > 1.0 - model.lost)
        told = z + model.sigma_1m * z * z * rng.normal(size=shape)
        depth = np.clip(np.rint(told / model.scale), 1, np.iinfo(np.uint16).max)
        depth[hole] = 0
        return np.asarray(depth.astype(np.uint16))

    def image(self, distances: Array, stamp: float, rng: np.random.Generator) -> RangeImage:
        """An image of true distances, through a frame and `DepthCamera`.

        Args:
            distances: Along the pixels' rays (z,) [m].
            stamp: When it was taken [s].
            rng: Of noise.
        """
        return self._adapter.image(self.frame(distances, rng), stamp=stamp)


def edges(z: Array, step: float) -> NDArray[np.bool_]:
    """The pixels on both sides of an edge of a depth image (rows, columns).

    In a picture of a plane 1/z is linear, so that its differences are all the same however inclined the plane is. Where
    one differs from those on both of its sides, z jumps; at a fold it is the same as one of them.

    Args:
        z: Depth [m].
        step: What a jump has to be [m].
    """
    found = np.zeros(z.shape, dtype=bool)
    for picture, mark in ((z, found), (z.T, found.T)):
        near = 1.0 / np.maximum(picture, 1e-3)
        rise = np.diff(near, axis=0)
        if len(rise) < 3:
            continue
        bend = np.abs(np.diff(rise, axis=0))  # between a difference and the next
        excess = np.empty_like(rise)
        excess[1:-1] = np.minimum(bend[:-1], bend[1:])
        excess[0], excess[-1] = bend[0], bend[-1]  # at the border there is one neighbour
        jump = excess > step * near[:-1] * near[1:]  # d(1/z) = -dz / z²
        mark[:-1] |= jump
        mark[1:] |= jump
    return found
