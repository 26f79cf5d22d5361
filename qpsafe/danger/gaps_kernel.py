"""Which points are near a robot's capsules, how far away, and how fast they come nearer, compiled: see `link_parts`."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, Vector, cross, dot, entry, inline, readable, row, scale

ON_AXIS = 1e-9  # a point nearer than that to an axis has no direction from it [m]


@inline
def _across(u: Vector) -> Vector:
    """A unit vector at right angles to a vector; any one where that is 0."""
    x, y, z = abs(u[0]), abs(u[1]), abs(u[2])
    other = (1.0, 0.0, 0.0) if x <= y and x <= z else (0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0)
    found = cross(u, other)
    size = sqrt(dot(found, found))
    return scale(1.0 / size, found) if size > 0.0 else other


_four, _three, _whole = (
    types.Array(kind, n, "C") for kind, n in ((types.float64, 4), (types.float64, 3), (types.int64, 1))
)


@entry(
    types.int64(_three, _four, readable(1), readable(2), readable(1), _whole, types.float64[::1], types.float64[:, ::1])
)
def near_pairs(
    places: Array, jacobians: Array, radii: Array, points: Array, most: Array, which: NDArray[np.int64],
    distances: Array, rows: Array,
) -> int:  # fmt: skip
    """Fill which, distances and rows, by part and then by point, of pairs that are not farther; returns how many.

    Args:
        places: Ends of the axes (c, 2, 3) [m].
        jacobians: Of these, linear (c, 2, 3, n).
        radii: (c,) [m].
        points: (p, 3) [m].
        most: Pairs of a part that are farther are left out (c,) [m]; what is no number is not.
        which: Numbers of the pairs, part times p plus point (c p,).
        distances: |p - a| - r (c p,) [m].
        rows: nᵀ J(a) (c p, n).
    """
    count = 0
    for c in range(radii.shape[0]):
        a = (places[c, 0, 0], places[c, 0, 1], places[c, 0, 2])
        u = (places[c, 1, 0] - a[0], places[c, 1, 1] - a[1], places[c, 1, 2] - a[2])
        uu = dot(u, u)
        for k in range(points.shape[0]):
            p = row(points, k)
            o = (p[0] - a[0], p[1] - a[1], p[2] - a[2])
            t = min(max(dot(o, u) / uu, 0.0), 1.0) if uu > 0.0 else 0.0
            away = (o[0] - t * u[0], o[1] - t * u[1], o[2] - t * u[2])
            length = sqrt(dot(away, away))
            if length - radii[c] > most[c]:
                continue
            n = _across(u) if length < ON_AXIS else scale(1.0 / length, away)
            which[count], distances[count] = c * points.shape[0] + k, length - radii[c]
            for j in range(rows.shape[1]):
                near = far = 0.0
                for i in range(3):
                    near += n[i] * jacobians[c, 0, i, j]
                    far += n[i] * jacobians[c, 1, i, j]
                rows[count, j] = (1.0 - t) * near + t * far  # J is linear between the ends, as in (4)
            count += 1
    return count
