"""Clouds of points that are given as they are: too many of them for a tick are reduced, or refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.reduction.nearest_kernel import reduce_points
from qpsafe.ranging.rules import RangeRules
from qpsafe.sensing.detection import BadInput, refuse_points
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.wire import Wire

Array = NDArray[np.float64]

TOO_MANY = 20_000  # points break the tick's deadline
_RULES = RangeRules()


def check_size(points: Array) -> None:
    """Refuse a cloud that a tick has no time for.

    Raises:
        BadInput: Too many points.
    """
    if len(points) > TOO_MANY:
        expected = f"at most {TOO_MANY}; a RangeImage of a sensor with so many zones is reduced in time"
        raise BadInput(f"{counted(len(points), 'point')} are given, expected {expected}")


def reduction(given: int, kept: int) -> str:
    """That so many points were reduced, in words."""
    return f"{counted(given, 'point')} are reduced to those nearest to the links, {kept}"


def reduced(points: Array, wire: Wire) -> Array:
    """The points of a cloud that are nearest to each link of the wire, as of an image (c, 3) [m].

    Args:
        points: (p, 3) [m].
        wire: Of the robot now.

    Raises:
        BadInput: A point is not finite.
    """
    if not np.isfinite(points).all():
        refuse_points(points)
    links = len(wire.starts)
    kept = np.empty((links * _RULES.each, 3))
    count = reduce_points(
        np.ascontiguousarray(points), wire.starts, wire.ends, np.empty((links, len(points))),
        np.empty(len(points), dtype=np.int64), _RULES.each, _RULES.spread, kept,
    )  # fmt: skip
    return kept[:count]
