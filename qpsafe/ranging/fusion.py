"""Which points an image looks through: what one sensor sees free deletes what another saw there only then.

A point is looked through if its ball (where it may be) is in zones of the image, and every zone that the ball touches
tells something and reads farther than the ball's far side, by the tolerance, by as many standard deviations as a
reading may be wrong, and by the radius of the zone's cone there. A zone that is not valid, that sees the robot or
anything else before the point, or that the ball only sticks out of, does not look through it; so nothing is deleted
that is merely out of sight.

The zones that a ball touches are found in a tree of balls around their directions, built once for a sensor whatever its
zones are: pixels, a planar fan, or directions without any order.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled.compiled import Array, entry, inline, readable
from qpsafe.robot.kinematics import Index

if TYPE_CHECKING:
    from qpsafe.ranging.sensor import RangeSensor

#: Zones in a leaf of the tree at least, leaves at most, and how deep it may be.
_LEAF, _LEAVES, _DEEPEST = 4, 8192, 48
#: Numbers of a call.
TOLERANCE, DEVIATIONS, FARTHEST, COVERS = range(4)
#: Columns of a zone: direction, half angle, tangent of it.
_HALF, _SLANT = 3, 4


@inline
def looks_through(
    x: float, y: float, z: float, error: float, nodes: Array, spans: Index, zones: Array, numbers_of: Index,
    distances: Array, valid: Array, sigma: Array, numbers: Array, stack: Index,
) -> bool:  # fmt: skip
    """Whether an image looks through a point at (x, y, z) in the sensor's frame, which may be wrong by `error`.

    Args:
        x, y, z, error: [m].
        nodes, spans, zones, numbers_of: Of the tree, see `LookingThrough`.
        distances, valid, sigma: Of the image (z,).
        numbers: See above.
        stack: To work in.
    """
    r = sqrt(x * x + y * y + z * z)
    if not 0.0 <= error < r:  # NaN fails, and a ball that holds the sensor
        return False
    x, y, z = x / r, y / r, z / r
    # chord of the ball's half angle α: sin α = error/r, chord 2 sin(α/2)
    sine = error / r
    cosine = sqrt(1.0 - sine * sine)
    chord = sqrt(max(2.0 - 2.0 * cosine, 0.0))
    inside, top = False, 1
    stack[0] = 0
    while top > 0:
        top -= 1
        k = stack[top]
        dx, dy, dz = x - nodes[k, 0], y - nodes[k, 1], z - nodes[k, 2]
        near = nodes[k, 3] + chord
        if dx * dx + dy * dy + dz * dz > near * near:
            continue
        if spans[k, 2] > 0:
            stack[top], stack[top + 1] = spans[k, 2], spans[k, 3]
            top += 2
            continue
        for i in range(spans[k, 0], spans[k, 1]):
            # cosine of the angle between the directions against that of half + α and of half - α
            along = x * zones[i, 0] + y * zones[i, 1] + z * zones[i, 2]
            c, s = np.cos(zones[i, _HALF]), np.sin(zones[i, _HALF])
            if along < c * cosine - s * sine - 1e-12:
                continue
            j = numbers_of[i]
            least = r + error + numbers[TOLERANCE] + r * zones[i, _SLANT]
            d = distances[j]
            if not (valid[j] and d >= 0.0):
                return False
            if d > numbers[FARTHEST]:  # nothing in sight: free as far as the sensor says so
                if not (numbers[COVERS] > 0.0 and least < numbers[FARTHEST]):
                    return False
            elif not d - numbers[DEVIATIONS] * sigma[j] > least:
                return False
            inside = inside or along >= c - 1e-12
    return inside


_rows, _floats, _whole = readable(2), readable(1), types.Array(types.int64, 1, "C", readonly=True)


@entry(
    types.void(
        _rows, _floats, _rows, _rows, types.Array(types.int64, 2, "C", readonly=True), _rows, _whole, _floats,
        types.Array(types.boolean, 1, "A", readonly=True), _floats, _floats, types.int64[::1], types.boolean[::1],
    )
)  # fmt: skip
def look_through(
    points: Array, errors: Array, pose: Array, nodes: Array, spans: Index, zones: Array, numbers_of: Index,
    distances: Array, valid: Array, sigma: Array, numbers: Array, stack: Index, out: Array,
) -> None:  # fmt: skip
    """Fill `out` (p,) with whether an image from a pose (4, 4) looks through points (p, 3) in the world."""
    for i in range(points.shape[0]):
        x, y, z = points[i, 0] - pose[0, 3], points[i, 1] - pose[1, 3], points[i, 2] - pose[2, 3]
        out[i] = looks_through(
            pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z,
            pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z,
            pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z,
            errors[i], nodes, spans, zones, numbers_of, distances, valid, sigma, numbers, stack,
        )  # fmt: skip


class LookingThrough:
    """Which points images of one sensor look through.

    Args:
        sensor: The sensor, or its tiles: what has the zones of the images.
        tolerance: That a reading has to be farther than a point, at least [m]; as in `SensingRules`.
        deviations: By how many standard deviations a reading may be wrong; as in `RangeRules`.

    Attributes:
        nodes: Balls of the tree (k, 4), centre and radius: in them the cones of all zones below end on the unit sphere.
        spans: First and last zone of each, and its two children, 0 for a leaf (k, 4).
        zones: In the tree's order: direction, half angle, its tangent (z, 5).
        order: Their numbers in the sensor (z,).
    """

    def __init__(self, sensor: RangeSensor, tolerance: float = 0.05, deviations: float = 3.0) -> None:
        half = np.asarray(sensor.half_angle)
        self.nodes, self.spans, self.order = _tree(sensor.directions, 2.0 * np.sin(0.5 * half))
        half = half[self.order]
        self.zones = np.column_stack((sensor.directions[self.order], half, np.tan(half)))
        self.numbers = np.array([tolerance, deviations, sensor.range_max, float(sensor.covers)])
        self._stack = np.zeros(2 * _DEEPEST, dtype=np.int64)

    def __call__(
        self,
        points: NDArray[np.float64],
        errors: ArrayLike,
        pose: NDArray[np.float64],
        distances: NDArray[np.float64],
        valid: NDArray[np.bool_],
        sigma: ArrayLike,
    ) -> NDArray[np.bool_]:
        """Which points an image looks through (p,). Points seen after the image was taken are none of its business.

        Args:
            points: In the world (p, 3) [m].
            errors: How far from there each may be, (p,) or one number [m].
            pose: Of the sensor when the image was taken (4, 4) [m].
            distances: Of the image's zones (z,) [m], in the sensor's order.
            valid: Which zones tell anything (z,).
            sigma: Standard deviations, (z,) or one number [m].
        """
        out = np.zeros(len(points), dtype=np.bool_)
        wrong = np.broadcast_to(np.asarray(errors, dtype=np.float64), (len(points),))
        spread = np.broadcast_to(np.asarray(sigma, dtype=np.float64), (len(self.zones),))
        look_through(
            points, wrong, pose, self.nodes, self.spans, self.zones, self.order, distances, valid, spread,
            self.numbers, self._stack, out,
        )  # fmt: skip
        return out


def _tree(directions: NDArray[np.float64], chords: NDArray[np.float64]) -> tuple[Array, Index, Index]:
    """Halve the zones along their widest axis until a few are left: balls, spans and children, the zones' order."""
    order = np.arange(len(directions))
    nodes: list[tuple[float, float, float, float]] = []
    spans: list[list[int]] = []
    waiting = [(0, len(order), -1, 0)]
    while waiting:
        first, last, parent, side = waiting.pop()
        here = directions[order[first:last]]
        low, high = here.min(axis=0), here.max(axis=0)
        middle = 0.5 * (low + high)
        reach = np.linalg.norm(here - middle, axis=1) + chords[order[first:last]]
        nodes.append((*middle.tolist(), float(reach.max(initial=-inf)) + 1e-9))
        spans.append([first, last, 0, 0])
        if parent >= 0:
            spans[parent][2 + side] = len(nodes) - 1
        if last - first > max(_LEAF, len(order) // _LEAVES):
            half = (first + last) // 2
            axis = int(np.argmax(high - low))
            sorted_ = np.argpartition(here[:, axis], half - first)
            order[first:last] = order[first:last][sorted_]
            waiting += [(half, last, len(nodes) - 1, 1), (first, half, len(nodes) - 1, 0)]
    return np.array(nodes), np.array(spans, dtype=np.int64), order
