"""How clusters of points move from image to image: what is known of it for certain.

A velocity is used where it raises danger only (`prediction`). So what counts is that nothing at rest
seems to move; what moves may seem slower than it is. Points of an image are clustered by single linkage, and each
cluster has a parent: the cluster of the image before, moved on by its velocity, that explains it best. Followed back
along its parents for a window, a cluster has moved by the smallest shift that explains it nearly as well, by distances
to nearest points, as the best shift does. Divided by the time between, that is its velocity. There is no filter, and so
nothing that rings; what accelerates by a is at most a window/2 faster than is said.

- A cluster grows or splits because something uncovers it, or ends at the edge of an image: old points explain the rest
  of it without any shift. None of them needs to be seen again: half of a cluster's points need a counterpart.
- Samples of a surface that slide along it with a sensor that moves look like motion. Only that sensor knows: it says
  how fast its own motion moves its rays there (`sweep`), and so much of a velocity, times `slope`, does not count.
- What jumps farther than `reach` and the fastest motion explain is new, and has no velocity before two more images.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.ranging.tracking.tracks_kernel import IMAGES, sizes, swept, track

_FLOAT = np.dtype(np.float64)


@dataclass(slots=True)
class _Ring:
    """Where the next image goes, how many there are, the stamp of the last one, and of the last that has a place."""

    slot: int = 0
    filled: int = 0
    stamp: float = -np.inf
    kept: float = -np.inf


class PointTracks(Fixed):
    """Velocities of the points of one sensor, or of several that look at the same time.

    Sensors that see different sides of a person have tracks of their own: the sides together would jump from one image
    to the next. The points should be all that a sensor sees nearby (a few to a few hundred): if only the few nearest to
    a robot that moves are given, they slide along what stands still.

    Args:
        reach: Points nearer to one another than this belong together; twice the distance of neighbours is enough [m].
        window: Over which motion is measured [s]. At least three images make a velocity; they may take up to three
            windows, so that 5 Hz is enough.
        fastest: A larger speed is cut to this [m/s].
        still: So much of a speed may be noise and does not count [m/s].
        slope: A ray that sweeps over a surface of up to this slope is no motion; √(1 + 1²) is 45 degrees.
        most: Points of an image that are looked at, the first ones; the others have no velocity. What an image costs
            grows as its square.

    Raises:
        ConfigurationError: A number is not finite or not in its range.
    """

    fixed = frozenset(("numbers", "most"))

    def __init__(
        self, *, reach: float = 0.2, window: float = 0.2, fastest: float = 2.5, still: float = 0.05,
        slope: float = sqrt(2.0), most: int = 128,
    ) -> None:  # fmt: skip
        given = {"reach": reach, "window": window, "fastest": fastest, "still": still, "slope": slope, "most": most}
        for key, value in given.items():
            least = {"still": 0.0, "slope": 0.0, "most": 3}.get(key, 1e-3)
            if isinstance(value, bool) or not least <= value < 1e4:
                raise ConfigurationError("PointTracks", key, value, f"a number >= {least:g}")
        self.most = int(most)
        self.numbers = np.array([reach, window, fastest, still, slope])
        floats, whole = sizes(self.most)
        self._memory = np.zeros(floats), np.zeros(whole, dtype=np.int64)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._ring = _Ring()

    def update(
        self, stamp: float, points: NDArray[np.float64], sigma: ArrayLike = 0.01, sweep: ArrayLike = 0.0
    ) -> NDArray[np.float64]:
        """Velocities (p, 3) of the points of an image, zero where none is known for certain [m/s].

        They do not depend on anything but what has been given since the last `reset`, and on the stamps by their
        differences only. An image not newer than the last one has none, and is forgotten; so is one with a stamp that
        is not finite. Points that are not finite have none.

        Args:
            stamp: When the image was taken [s].
            points: In the world (p, 3) [m], the most important first.
            sigma: Standard deviation of each, (p,) or one number [m].
            sweep: How fast the sensor's own motion moves its rays aside there, (p,) or one number [m/s], see `sweep`.
        """
        velocities = np.zeros((len(points), 3))
        ring = self._ring
        if not (stamp > ring.stamp and stamp < np.inf):
            return velocities
        # images that follow one another fast replace each other, so that a window of them finds room
        replaces = ring.filled > 0 and stamp - ring.kept < self.numbers[1] / (IMAGES - 4)
        if not replaces:
            ring.slot, ring.filled = (ring.slot + 1) % IMAGES, min(ring.filled + 1, IMAGES)
            ring.kept = stamp
        spread, aside = _each(sigma, len(points)), _each(sweep, len(points))
        ring.stamp = stamp
        track(
            points, spread, aside, stamp, self.numbers, self.most, ring.slot, ring.filled - 1, *self._memory, velocities
        )
        return velocities


def _each(value: ArrayLike, count: int) -> NDArray[np.float64]:
    """A number for each point, or one for all of them: the caller's own array if it may be."""
    if type(value) is np.ndarray and value.dtype == _FLOAT and value.shape in ((count,), (1,)):
        return value
    return np.full(count, value, dtype=np.float64)


def sweep(
    points: NDArray[np.float64], before: NDArray[np.float64], now: NDArray[np.float64], dt: float
) -> NDArray[np.float64]:
    """How fast a sensor's own motion moves aside what it seems to see, (p,) [m/s]: 0 for one that stands still.

    Rays slide over what stands still, and so do the shadows of what is nearer (by parallax, as the sensor's place
    moves): the sum of both speeds.

    Args:
        points: Seen now, in the world (p, 3) [m].
        before: Pose of the sensor in the world at an earlier time (4, 4) [m].
        now: Its pose now (4, 4) [m].
        dt: Time between [s], > 0.
    """
    aside = np.empty(len(points))
    swept(points, before, now, dt, aside)
    return aside
