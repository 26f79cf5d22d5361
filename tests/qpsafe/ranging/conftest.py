"""Poses of sensors of many zones, and what they read of people made of balls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from qpsafe.ranging.sensor import RangeSensor

Array = NDArray[np.float64]


def looking(at: Sequence[float], place: Sequence[float]) -> Array:
    """Pose of a sensor at a place whose z axis points to another one, y down as far as that is possible."""
    z = np.asarray(at, dtype=float) - place
    z /= np.linalg.norm(z)
    x = np.cross(z, (0.0, 0.0, 1.0) if abs(z[2]) < 0.9 else (1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack((x, np.cross(z, x), z), axis=1), place
    return pose


def seen(sensor: RangeSensor, pose: Array, balls: Sequence[tuple[float, float, float, float]]) -> Array:
    """What ideal zones read of balls (x, y, z, radius): along their axes only, +inf where there is none."""
    origin, axes = pose[:3, 3], sensor.directions @ pose[:3, :3].T
    distances = np.full(len(sensor), np.inf)
    for *centre, radius in balls:
        m = np.asarray(centre) - origin
        along = axes @ m
        inside = radius**2 - (m @ m - along**2)
        hit = (inside > 0.0) & (along > 0.0)
        distances[hit] = np.minimum(distances[hit], along[hit] - np.sqrt(inside[hit]))
    return distances


class Eyes:
    """What tests look with."""

    looking, seen = staticmethod(looking), staticmethod(seen)


@pytest.fixture(scope="session")
def eyes() -> type[Eyes]:
    """`looking(at, place)` and `seen(sensor, pose, balls)`."""
    return Eyes
