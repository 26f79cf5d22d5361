"""One distance sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spot:
    """One distance sensor.

    Attributes:
        name: Shown in reports.
        link: Wire link that carries it, counted from 0; its danger vector acts on this link, eq. (8).
        frame: Frame in which its pose is given: the Denavit-Hartenberg frame of that link.
        pose: The constant matrix of eq. (7) from that frame to the spot's, whose z axis is the measuring direction,
            (4, 4) [m].
        range_min: Smallest distance the sensor resolves [m].
        range_max: Largest distance that counts as a detection [m].
        field_of_view: Full opening angle of the cone it sees [rad]. The point is always put on the cone's axis.
    """

    name: str
    link: int
    frame: str
    pose: Array
    range_min: float
    range_max: float
    field_of_view: float


def axes_along(directions: Array) -> Array:
    """Rotations whose z axes are unit directions (..., 3), axes in columns (..., 3, 3); turned about them anyhow."""
    x = np.cross(np.eye(3)[np.abs(directions).argmin(axis=-1)], directions)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack((x, np.cross(directions, x), directions), axis=-1)
