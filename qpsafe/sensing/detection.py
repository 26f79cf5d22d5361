"""Raw input of one tick as arrays that can be used, or a plain report of what is wrong with it."""

from __future__ import annotations

import functools
from math import isfinite
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import Array, Vector, add, dot, entry, inline, readable, row

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.wire import Wire


class BadInput(Exception):
    """Input of one tick that cannot be used; caught inside `SafetyController.step`, which reports it."""


_FLOAT = np.dtype(np.float64)

#: How far outside its limits a measured joint may be, one that turns and one that slides [rad, m], and how many times
#: its largest speed it may have. Beyond it is no measurement but, say, degrees taken for radians.
PLAUSIBLE_EXCESS, SLIDING_EXCESS, PLAUSIBLE_SPEED = np.pi, 0.1, 10.0


def as_joint_position(value: ArrayLike, robot: Robot) -> NDArray[np.float64]:
    """Measured q (n,) [rad], finite and not absurd, the caller's own array if it may be; or BadInput."""
    lowest, highest, _, _ = plausible(robot)
    return _as_joint_vector("q", value, lowest, highest, robot.joint_names)


def as_joint_velocity(value: ArrayLike, robot: Robot) -> NDArray[np.float64]:
    """Measured q̇ (n,) [rad/s], finite and not absurd, the caller's own array if it may be; or BadInput."""
    _, _, lowest, highest = plausible(robot)
    return _as_joint_vector("qd", value, lowest, highest, robot.joint_names)


@functools.lru_cache(maxsize=16)
def plausible(robot: Robot) -> tuple[NDArray[np.float64], ...]:
    """Lowest and highest position, lowest and highest velocity that can be a measurement, (n,) each."""
    speed, beyond = PLAUSIBLE_SPEED * robot.max_velocity, np.where(robot.sliding, SLIDING_EXCESS, PLAUSIBLE_EXCESS)
    return robot.lower - beyond, robot.upper + beyond, -speed, speed


def _as_joint_vector(
    name: str, value: ArrayLike, lowest: NDArray[np.float64], highest: NDArray[np.float64], joints: tuple[str, ...]
) -> NDArray[np.float64]:
    array = as_floats(name, value)
    if array.shape != lowest.shape:
        raise BadInput(f"{name} has shape {array.shape}, expected {lowest.shape}")
    if not _all_between(lowest, array, highest):
        sane = (lowest <= array) & (array <= highest)
        if not np.isfinite(array).all():
            raise BadInput(f"{name} is not finite: {array}")
        values = [f"{joints[i]} = {array[i]:g}" for i in np.flatnonzero(~sane)]
        raise BadInput(f"{name} is too far outside the limits to be a measurement: " + ", ".join(values))
    return array


@entry(types.boolean(readable(1), readable(1), readable(1)))
def _all_between(lowest: Array, array: Array, highest: Array) -> bool:
    good = True
    for i in range(array.shape[0]):
        good = good and lowest[i] <= array[i] <= highest[i]  # false for NaN
    return good


def refuse(q: ArrayLike, qd: ArrayLike, robot: Robot) -> NoReturn:
    """Say what is wrong with a measurement that compiled code refused.

    Args:
        q: Joint position, as given.
        qd: Joint velocity, as given.
        robot: Whose measurement it is.

    Raises:
        BadInput: Always.
    """
    as_joint_position(q, robot), as_joint_velocity(qd, robot)
    raise BadInput("q or qd is no measurement")


def as_points(value: ArrayLike) -> NDArray[np.float64]:
    """Points (p, 3) [m], the caller's own array if it may be; or BadInput."""
    points = as_floats("points", value)
    if points.shape == (0,):  # an empty list
        points = points.reshape(0, 3)
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadInput(f"points have shape {points.shape}, expected (p, 3)")
    return points


def refuse_points(points: NDArray[np.float64]) -> NoReturn:
    """Say which points are not finite.

    Raises:
        BadInput: Always.
    """
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    raise BadInput("points are not finite: number " + ", ".join(str(i) for i in bad))


def nearest_link(points: NDArray[np.float64], wire: Wire) -> NDArray[np.int64]:
    """Wire link nearest to each point (p, 3): (p,), the first one where several are equally near.

    Links share their ends, so that is no rare case: rounding must not decide it.
    """
    links = np.empty(len(points), dtype=np.int64)
    find_nearest(points, wire.starts, wire.ends, links)
    return links


@inline
def _distance2(p: Vector, r0: Vector, r1: Vector) -> float:
    """Square of the distance of p to a segment; infinite where p is too far away for it."""
    d, w = add(r1, -1.0, r0), add(p, -1.0, r0)
    n = add(w, -min(max(dot(w, d) / max(dot(d, d), 1e-300), 0.0), 1.0), d)
    return dot(n, n)


@entry(types.boolean(readable(2), readable(2), readable(2), types.int64[::1]), compiled)
def find_nearest(points: Array, r0: Array, r1: Array, links: Array) -> bool:
    """Fill the links; returns whether all points are finite."""
    good = True
    for i in range(points.shape[0]):
        p = row(points, i)
        good = good and isfinite(p[0]) and isfinite(p[1]) and isfinite(p[2])
        smallest, links[i] = np.inf, 0
        for j in range(r0.shape[0]):
            smallest = min(smallest, _distance2(p, row(r0, j), row(r1, j)))
        for j in range(r0.shape[0] - 1, -1, -1):
            if _distance2(p, row(r0, j), row(r1, j)) <= (1.0 + 1e-9) * smallest + 1e-18:
                links[i] = j
    return good


def as_floats(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """`value` as a float64 array; real numbers only: no text, no bool, nothing complex, None or masked."""
    if type(value) is np.ndarray and value.dtype == _FLOAT:  # the usual case
        return value
    try:
        array = np.asarray(value)
    except Exception as error:  # whatever a stranger's __array__ raises
        raise BadInput(f"{name} is not an array of numbers ({type(error).__name__})") from None
    if array.dtype.kind not in "fiu":
        raise BadInput(f"{name} is not an array of real numbers but of {array.dtype}")
    if np.ma.is_masked(value):
        raise BadInput(f"{name} has masked values")
    with np.errstate(over="ignore"):  # long double beyond float64 becomes infinite
        return np.array(array, dtype=np.float64)


def reals(whose: str, value: object, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """What a part of another making answered, as float64 of this shape; its own array if it may be.

    Args:
        whose: What a person calls it, for the error.
        value: What came.
        shape: That is expected.

    Raises:
        TypeError: Text, something complex, masked or no numbers at all.
        ValueError: Another shape.
    """
    array = value
    if not (type(array) is np.ndarray and array.dtype == _FLOAT):
        array = np.asarray(value)
        if array.dtype.kind not in "fiu" or np.ma.is_masked(value):
            what = "of masked values" if array.dtype.kind in "fiu" else f"of {array.dtype}"
            raise TypeError(f"{whose} is not an array of real numbers but {what}")
        array = array.astype(float)
    if array.shape != shape:
        raise ValueError(f"{whose} has shape {array.shape}, expected {shape}")
    return array
