"""Which zones see something that moves: whatever stands still in the cell is no outlier then, it is not there."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.ranging.extrinsics.recording import Recording

Array = NDArray[np.float64]

#: What is nearer than the background by this and by as many standard deviations has moved there [m].
STEP, DEVIATIONS = 0.06, 4.0
#: The background of a zone is nearer than this share of what it has read, the robot was before it in the others; from
#: a second share, both of a normal distribution, its deviation.
_BACKGROUND, _SECOND = 0.85, 0.65
_SPREAD = 1.0 / (1.0364 - 0.3853)
#: Two neighbours that differ by more are an edge, where distances are mixed [m].
_EDGE = 0.08
#: Rows or columns from which on leaving out the edges leaves enough.
_FINE = 96


class Rays(NamedTuple):
    """Some zones of an image.

    Attributes:
        directions: In the camera's frame (k, 3).
        distances: What they read (k,) [m].
        sigma: Standard deviations (k,) [m].
        moving: Which of them see something that moves (k,).
    """

    directions: Array
    distances: Array
    sigma: Array
    moving: NDArray[np.bool_]


class Moving:
    """What moves in the images of a recording.

    Args:
        recording: The images.
        most: Zones of an image at most that see something that moves, chosen at random; three times as many others.
        seed: Of the choice.

    Attributes:
        rays: Of each image.
        least: The smallest standard deviation of a reading [m].
    """

    def __init__(self, recording: Recording, most: int, seed: int = 0) -> None:
        rng, sensor = np.random.default_rng(seed), recording.sensor
        self.rays: list[Rays] = []
        distances, shape = recording.distances, sensor.shape
        background, second = _share(distances, _BACKGROUND), _share(distances, _SECOND)
        noise = _noise(background, second)
        far = np.where(np.isfinite(background), background, 0.0)
        nearer = distances < background - STEP - DEVIATIONS * np.maximum(noise * far**2, sensor.sigma)  # NaN fails
        self.least = np.inf
        for image, read in enumerate(distances):
            clear = ~_edges(read.reshape(shape)).ravel() & ~np.isnan(read)
            chosen = []
            for zones, room in ((nearer[image], most), (~nearer[image], 3 * most)):
                zones = np.flatnonzero(zones & clear)
                chosen.append(np.sort(rng.choice(zones, size=room, replace=False)) if len(zones) > room else zones)
            zones = np.concatenate(chosen)
            finite = np.where(np.isfinite(read[zones]), read[zones], 0.0)
            sigma = np.maximum(noise * finite**2, 1e-3)
            self.least = min(self.least, float(sigma.min(initial=np.inf)))
            moves = np.arange(len(zones)) < len(chosen[0])
            self.rays.append(Rays(np.ascontiguousarray(sensor.directions[zones]), read[zones], sigma, moves))

    @property
    def points(self) -> list[Array]:
        """What moves in each image, in the camera's frame, (k, 3) each [m]."""
        return [r.directions[r.moving] * r.distances[r.moving, None] for r in self.rays]


def _share(distances: Array, share: float) -> Array:
    """What each zone (z,) reads nearer than in this share of its images; NaN where it never reads anything."""
    count = (~np.isnan(distances)).sum(axis=0)
    ordered = np.sort(distances, axis=0)  # NaN last
    place = np.minimum((share * count).astype(int), np.maximum(count - 1, 0))
    return np.asarray(ordered[place, np.arange(distances.shape[1])])


def _noise(background: Array, second: Array) -> float:
    """Standard deviation of a reading at 1 m if it grows with the square, as that of a stereo camera does [m]."""
    finite = np.isfinite(background) & np.isfinite(second) & (background > 0.0)
    each = _SPREAD * (background[finite] - second[finite]) / background[finite] ** 2
    return float(np.median(each)) if finite.any() else 0.0


def _edges(image: Array) -> NDArray[np.bool_]:
    """Zones beside a step, or beside one that tells nothing, in fine images."""
    edge = np.zeros(image.shape, dtype=bool)
    for axis in (0, 1):
        if image.shape[axis] < _FINE:
            continue
        with np.errstate(invalid="ignore"):
            step = ~(np.abs(np.diff(image, axis=axis)) < _EDGE)
        for side in ((1, 0), (0, 1)):
            edge |= np.pad(step, [side if a == axis else (0, 0) for a in (0, 1)])
    return edge
