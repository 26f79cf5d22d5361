"""Which rays can meet boxes at all: the cheap question before MuJoCo casts them against what is in the boxes."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, entry, readable


def may_meet(
    points: Array, directions: Array, centres: Array, axes: Array, boxes: Array, reach: float, widest: float
) -> NDArray[np.bool_]:
    """Which rays (k,) come within `widest` of some box before `reach`; some that do not are counted too, at corners.

    Args:
        points: Where rays start, (k, 3) [m].
        directions: Unit, (k, 3).
        centres: Origins of frames that the boxes are given in, (m, 3) [m].
        axes: Rotation matrices of these frames, (m, 3, 3).
        boxes: Centre and half lengths in them, (m, 6) [m].
        reach: Length of the rays [m].
        widest: [m].
    """
    near = np.empty(len(points), dtype=np.bool_)
    _may_meet(points, directions, centres, axes, boxes, reach, widest, near)
    return near


@entry(
    types.void(
        readable(2),
        readable(2),
        readable(2),
        readable(3),
        readable(2),
        types.float64,
        types.float64,
        types.boolean[::1],
    )
)
def _may_meet(
    points: Array,
    directions: Array,
    centres: Array,
    axes: Array,
    boxes: Array,
    reach: float,
    widest: float,
    near: Array,
) -> None:
    for i in range(points.shape[0]):
        near[i] = False
        for g in range(boxes.shape[0]):
            first, last = 0.0, reach
            for a in range(3):  # between the two planes of the box across each of its axes
                offset, slope = -boxes[g, a], 0.0
                for b in range(3):
                    offset += axes[g, b, a] * (points[i, b] - centres[g, b])
                    slope += axes[g, b, a] * directions[i, b]
                half = boxes[g, 3 + a] + widest
                if abs(slope) < 1e-12:
                    if abs(offset) > half:
                        last = -1.0
                    continue
                one, two = (-half - offset) / slope, (half - offset) / slope
                first, last = max(first, min(one, two)), min(last, max(one, two))
            if first <= last:
                near[i] = True
                break
