"""What a batch is told at a tick, as arrays that a kernel can take."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.batch import code
from qpsafe.sensing.detection import BadInput, as_floats, as_points
from qpsafe.text.words import counted

Array = NDArray[np.float64]

_NO_ROWS, _NO_POINTS = np.zeros((1, 0)), np.zeros((0, 3))


class Given(NamedTuple):
    """Arguments of `step_rows` from `q` on, and what is wrong with them.

    Attributes:
        q, qd: (n, joints).
        distances, ages: (n, k), or (1, 0).
        points: Of all robots, one after the other (p, 3).
        starts: Where each robot's begin (n + 1,).
        how: `DISTANCES`, `POINTS` or `NOTHING`.
        wrong: What is wrong with all of it, in words; empty if nothing is.
        most: Points of the robot that has most.
    """

    q: Array
    qd: Array
    distances: Array
    ages: Array
    points: Array
    starts: NDArray[np.int64]
    how: int
    wrong: str
    most: int


def take(
    shape: tuple[int, int], spots: int, q: ArrayLike, qd: ArrayLike, distances: ArrayLike | None, points: Any, ages: Any
) -> Given:
    """What is given, or nothing with a word why: shapes are one for all, so all robots brake then.

    Args:
        shape: Robots, joints.
        spots: How many a robot has.
        q, qd, distances, points, ages: As for `BatchController.step`.
    """
    starts, wrong = np.zeros(shape[0] + 1, dtype=np.int64), ""
    joints = np.full(shape, np.nan), np.full(shape, np.nan)
    try:
        joints = _shaped("q", q, shape), _shaped("qd", qd, shape)
        if distances is not None and points is not None:
            raise BadInput("both distances and points are given, expected one of them")
        if points is None and np.ndim(distances) == 3:  # type: ignore[arg-type]
            distances, points = None, distances
        if points is not None:
            if ages is not None:  # old points would count as seen now
                raise BadInput("ages are given with points, which have none: leave out points that are too old")
            flat, counts = _flat(points, shape[0])
            np.cumsum(counts, out=starts[1:])
            most = int(counts.max(initial=0))
            return Given(*joints, _NO_ROWS, _NO_ROWS, flat, starts, code.POINTS, "", most)
        if distances is None:
            raise BadInput("neither distances nor points are given; where nothing is in sight, say points=[[], ...]")
        seen = _shaped("distances", distances, (shape[0], spots))
        age = np.zeros(seen.shape) if ages is None else _broadcast("ages", ages, seen.shape)
        return Given(*joints, seen, age, _NO_POINTS, starts, code.DISTANCES, "", 0)
    except BadInput as error:
        wrong = str(error)
    return Given(*joints, _NO_ROWS, _NO_ROWS, _NO_POINTS, starts, code.NOTHING, wrong, 0)


def _shaped(name: str, value: ArrayLike, shape: tuple[int, int]) -> Array:
    array = as_floats(name, value)
    if array.shape != shape:
        raise BadInput(f"{name} have shape {array.shape}, expected {shape}")
    return array


def _broadcast(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = as_floats(name, value)
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise BadInput(f"{name} have shape {array.shape}, expected {shape}, or what becomes that") from None


def _flat(points: Any, n: int) -> tuple[Array, NDArray[np.int64]]:
    """Points of all robots, one after the other, and how many each has; rows of NaN are none."""
    if isinstance(points, np.ndarray) and points.ndim == 3:
        array = as_floats("points", points)
        if array.shape[0] != n or array.shape[2] != 3:
            raise BadInput(f"points have shape {array.shape}, expected ({n}, p, 3)")
        there = ~np.isnan(array).all(axis=2)
        return array[there], there.sum(axis=1)
    if not (isinstance(points, list | tuple) and len(points) == n):
        raise BadInput(
            f"points are not those of {counted(n, 'robot')}: a list of as many arrays, or an array ({n}, p, 3)"
        )
    rows = []
    for given in points:
        try:
            rows.append(as_points(given))
        except BadInput:  # this robot's alone
            rows.append(np.full((1, 3), np.nan))
    return np.concatenate(rows), np.array([len(row) for row in rows])
