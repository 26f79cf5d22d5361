"""How fast what a spot sees comes nearer: an alpha-beta filter along each ray.

The source takes obstacles as standing still. This estimate is an option. A ray that sweeps over a surface tells nothing
of motion along the surface, so only the part along the ray is estimated, and only an approach is passed on: a point
that goes away is no reason to count less danger.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.danger.compiled import Array, entry, readable


class ApproachVelocity:
    """Velocity of each spot's point along its ray.

    With z the point's place along the ray in the world (measured distance plus the spot's own motion along the ray), at
    each tick x <- x + v dt, r = z - x, x <- x + α r, v <- v + β r/dt, where β = α²/(2 - α).

    Args:
        count: Number of spots.
        dt: Tick [s].
        time_constant: Of the filter, dt/α [s].
        fastest: A larger speed is cut to this [m/s].
    """

    def __init__(self, count: int, dt: float, time_constant: float = 0.04, fastest: float = 2.0) -> None:
        self._dt, self._fastest = dt, fastest
        self._alpha = min(dt / time_constant, 1.0)
        self._beta = self._alpha**2 / (2.0 - self._alpha)
        self._count = count
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        k = self._count
        self._distance = np.full(k, np.nan)  # last reading, NaN for none
        self._origin = np.zeros((k, 3))
        self._error = np.zeros(k)  # z - x
        self.speed = np.zeros(k)  # along the ray, negative where it comes nearer

    def update(self, distances: Array, fresh: NDArray[np.bool_], origins: Array, directions: Array) -> Array:
        """Velocity (k, 3) of every point after this tick [m/s]; zero where nothing approaches.

        Args:
            distances: Readings (k,) [m].
            fresh: Where they are readings of the same obstacle as before or of a new one; the others start anew (k,).
            origins: Of the spots (k, 3) [m].
            directions: Of the spots (k, 3).
        """
        velocities = np.empty((self._count, 3))
        _track(
            distances,
            fresh,
            origins,
            directions,
            self._dt,
            self._alpha,
            self._beta,
            self._fastest,
            self._distance,
            self._origin,
            self._error,
            self.speed,
            velocities,
        )
        return velocities


#: A reading that changes faster than this starts the filter anew [m/s].
_JUMP = 12.5


@entry(
    types.void(
        readable(1),
        types.Array(types.boolean, 1, "A", readonly=True),
        readable(2),
        readable(2),
        types.float64,
        types.float64,
        types.float64,
        types.float64,
        types.float64[::1],
        types.float64[:, ::1],
        types.float64[::1],
        types.float64[::1],
        types.float64[:, ::1],
    )
)
def _track(
    distances: Array,
    fresh: Array,
    origins: Array,
    directions: Array,
    dt: float,
    alpha: float,
    beta: float,
    fastest: float,
    last: Array,
    origin: Array,
    error: Array,
    speed: Array,
    velocities: Array,
) -> None:
    for i in range(distances.shape[0]):
        change = distances[i] - last[i]
        for j in range(3):
            change += directions[i, j] * (origins[i, j] - origin[i, j])
        if fresh[i] and abs(change) < _JUMP * dt:  # NaN fails: no reading before
            r = error[i] + change - speed[i] * dt
            error[i] = (1.0 - alpha) * r
            speed[i] += beta * r / dt
        else:
            error[i] = speed[i] = 0.0
        last[i] = distances[i] if fresh[i] else np.nan
        approach = max(min(speed[i], 0.0), -fastest)
        for j in range(3):
            origin[i, j] = origins[i, j]
            velocities[i, j] = approach * directions[i, j]
