"""How fast what a spot sees comes nearer: an alpha-beta filter along each ray.

The paper takes obstacles as standing still, as `SensingRules(velocities=False)` does. A ray that sweeps over a surface
tells nothing of motion along the surface, so only the part along the ray is estimated, and only an approach is passed
on: a point that goes away is no reason to count less danger. Of an approach what is above `STILL` is passed on, so that
noise before something at rest is none, and above what a ray that sweeps over a slope may show; there is no step.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from qpsafe.compiled.compiled import Array, Vector, inline
from qpsafe.fixed import Fixed


class ApproachVelocity(Fixed):
    """Velocity of each spot's point along its ray.

    With z the point's place along the ray in the world (measured distance plus the spot's own motion along the ray), at
    each tick x <- x + v dt, r = z - x, x <- x + α r, v <- v + β r/dt, where β = α²/(2 - α).

    Args:
        count: Number of spots.
        dt: Tick [s].
        time_constant: Of the filter, dt/α [s].
        fastest: A larger speed is cut to this [m/s].
    """

    fixed = frozenset(("alpha", "beta", "fastest"))

    def __init__(self, count: int, dt: float, time_constant: float = 0.04, fastest: float = 2.0) -> None:
        self.alpha = min(dt / time_constant, 1.0)
        self.beta = self.alpha**2 / (2.0 - self.alpha)
        self.fastest = fastest
        #: Columns: last reading, NaN for none; z - x; v, negative where it comes nearer; the spot's place, direction;
        #: for how long it has seen something [s].
        self.track = np.empty((count, 10))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.track[:] = 0.0
        self.track[:, 0] = np.nan


#: A reading that changes faster than this starts the filter anew [m/s].
_JUMP = 12.5
#: So much of an approach may be noise and does not count: before something at rest the estimates of twenty noisy Sharp
#: sensors stay below 0.04 m/s at 0.5 m and 0.09 m/s at the end of their range [m/s].
STILL = 0.1
#: A ray that sweeps over a slope reads it nearer and nearer; up to this slope that is no approach.
SLOPE = 1.0

#: Until something has been seen for so long its estimate has not settled, and nobody knows whether it comes [s].
SETTLING = 0.1
_ROUNDING = 1e-6  # of times that are summed up [s]
_PLACE, _DIRECTION, _SEEN = 3, 6, 9


def unsettled(track: Array) -> bool:
    """Whether any spot sees something that it has not seen for `SETTLING` yet.

    Args:
        track: As in `ApproachVelocity`.
    """
    new = False
    for i in range(track.shape[0]):
        new = new or (track[i, 0] == track[i, 0] and track[i, _SEEN] < SETTLING - _ROUNDING)
    return new


unsettled_compiled = inline(unsettled)


@inline
def approach(
    i: int,
    d: float,
    fresh: bool,
    known: bool,
    origin: Vector,
    direction: Vector,
    dt: float,
    alpha: float,
    beta: float,
    fastest: float,
    track: Array,
) -> float:
    """Velocity of spot i's point along its ray after this tick, <= 0: only what approaches for certain counts [m/s].

    Args:
        i: Number of the spot.
        d: Its reading [m].
        fresh: Whether it is a reading of the same obstacle as before or of a new one; else the filter starts anew.
        known: Whether anything was there before, seen or held: what is lost for a moment is not new when it is back.
        origin, direction: Of the spot now.
        dt, alpha, beta, fastest, track: As in `ApproachVelocity`.
    """  # fmt: skip
    along, aside = 0.0, 0.0
    for j in range(3):
        along += direction[j] * (origin[j] - track[i, _PLACE + j])
    for j in range(3):  # how the ray's own motion moves the point: along the ray, and aside
        moved = origin[j] - track[i, _PLACE + j] + d * (direction[j] - track[i, _DIRECTION + j]) - along * direction[j]
        aside += moved * moved
        track[i, _PLACE + j], track[i, _DIRECTION + j] = origin[j], direction[j]
    change = d - track[i, 0] + along
    if fresh and abs(change) < _JUMP * dt:  # NaN fails: no reading before
        r = track[i, 1] + change - track[i, 2] * dt
        track[i, 1] = (1.0 - alpha) * r
        track[i, 2] += beta * r / dt
        track[i, _SEEN] += dt
    else:
        track[i, 1] = track[i, 2] = 0.0
        if fresh and (not known or abs(change) >= _JUMP * dt):  # somebody else; what was held is still the same
            track[i, _SEEN] = 0.0
    track[i, 0] = d if fresh else np.nan
    if not fresh:
        return 0.0
    return max(min(track[i, 2] + STILL + SLOPE * sqrt(aside) / dt, 0.0), -fastest)
