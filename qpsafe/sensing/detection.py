"""From raw input of one tick to the points that count, or a plain report of what is wrong with it."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.sensing.health import CLEAR

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.robot.wire import Wire
    from qpsafe.sensing.sensing import DistanceSensing


class BadInput(Exception):
    """Input of one tick that cannot be used; caught inside `SafetyController.step`, which reports it."""


class Detection(NamedTuple):
    """Points that count in this tick.

    Attributes:
        points: (p, 3), world frame [m].
        links: Wire link of each point, (p,), from 0.
        velocities: Of the points (p, 3) [m/s], or None where they are taken as standing still.
        notes: What is wrong with the sensors, in words.
        capped: Whether the robot has to go slowly, since a sensor is dead.
    """

    points: NDArray[np.float64]
    links: NDArray[np.int64]
    velocities: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()
    capped: bool = False


#: How far outside its limits a measured joint may be [rad], and how many times its largest speed it may have. Beyond
#: it is no measurement but, say, degrees taken for radians.
PLAUSIBLE_EXCESS, PLAUSIBLE_SPEED = np.pi, 10.0


def as_joint_position(value: ArrayLike, robot: Robot) -> NDArray[np.float64]:
    """Measured q (n,) [rad], finite and not absurd, as an array of its own; or BadInput."""
    lowest, highest, _, _ = _plausible(robot)
    return _as_joint_vector("q", value, lowest, highest, robot.joint_names)


def as_joint_velocity(value: ArrayLike, robot: Robot) -> NDArray[np.float64]:
    """Measured q̇ (n,) [rad/s], finite and not absurd, as an array of its own; or BadInput."""
    _, _, lowest, highest = _plausible(robot)
    return _as_joint_vector("qd", value, lowest, highest, robot.joint_names)


@functools.lru_cache(maxsize=16)
def _plausible(robot: Robot) -> tuple[NDArray[np.float64], ...]:
    """Lowest and highest position, lowest and highest velocity that can be a measurement, (n,) each."""
    speed = PLAUSIBLE_SPEED * robot.max_velocity
    return robot.lower - PLAUSIBLE_EXCESS, robot.upper + PLAUSIBLE_EXCESS, -speed, speed


def _as_joint_vector(
    name: str, value: ArrayLike, lowest: NDArray[np.float64], highest: NDArray[np.float64], joints: tuple[str, ...]
) -> NDArray[np.float64]:
    array = _as_floats(name, value)
    if array.shape != lowest.shape:
        raise BadInput(f"{name} has shape {array.shape}, expected {lowest.shape}")
    sane = (lowest <= array) & (array <= highest)  # false for NaN
    if not sane.all():
        if not np.isfinite(array).all():
            raise BadInput(f"{name} is not finite: {array}")
        wild = ~sane
        values = [f"{joints[i]} = {array[i]:g}" for i in np.flatnonzero(wild)]
        raise BadInput(f"{name} is too far outside the limits to be a measurement: " + ", ".join(values))
    return array


def as_detection(
    state: RobotState,
    wire: Wire,
    sensing: DistanceSensing | None,
    distances: ArrayLike | None,
    points: ArrayLike | None,
    ages: ArrayLike | None = None,
) -> Detection:
    """The detected points of one tick.

    Args:
        state: Robot at the measured joint position.
        wire: Its wire model.
        sensing: The distance sensors with what they remember, or None.
        distances: One reading per spot (k,) [m], or points (p, 3), or None.
        points: Points (p, 3) [m], or None.
        ages: How old each distance is (k,), or one number for all [s].

    Raises:
        BadInput: Wrong shape; too many spots out of order; a point that is not finite; both or neither kind given:
            silence is not safety, "nothing in sight" is said by distances of +inf or an empty list of points.
    """
    if distances is not None and points is not None:
        raise BadInput("both distances and points are given, expected one of them")
    if distances is not None:
        array = _as_floats("distances", distances)
        if array.ndim == 2 and array.shape[1] == 3:
            return _from_points(wire, array)
        return _from_distances(state, wire, sensing, array, ages)
    if points is not None:
        return _from_points(wire, _as_floats("points", points))
    raise BadInput("neither distances nor points are given; where nothing is in sight, say points=[]")


def _from_distances(
    state: RobotState,
    wire: Wire,
    sensing: DistanceSensing | None,
    distances: NDArray[np.float64],
    ages: ArrayLike | None,
) -> Detection:
    if sensing is None:
        raise BadInput("distances are given but the robot has no spots")
    shape = (len(sensing.spots),)
    if distances.shape != shape:
        raise BadInput(f"distances have shape {distances.shape}, expected {shape}")
    if ages is not None:
        ages = _as_floats("ages", ages)
        if ages.shape not in ((), shape):
            raise BadInput(f"ages have shape {ages.shape}, expected {shape} or one number")
        ages = np.broadcast_to(ages, shape)
    seen = sensing.update(state, wire, distances, ages)
    if seen.too_many:
        raise BadInput("; ".join(seen.notes))
    return Detection(seen.points, seen.links, seen.velocities, seen.notes, seen.severity != CLEAR)


def _from_points(wire: Wire, points: NDArray[np.float64]) -> Detection:
    if points.shape == (0,):  # an empty list
        points = points.reshape(0, 3)
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadInput(f"points have shape {points.shape}, expected (p, 3)")
    if not np.isfinite(points).all():
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        raise BadInput("points are not finite: number " + ", ".join(str(i) for i in bad))
    return Detection(points, nearest_link(points, wire))


def nearest_link(points: NDArray[np.float64], wire: Wire) -> NDArray[np.int64]:
    """Wire link nearest to each point (p, 3): (p,), the first one where several are equally near.

    Links share their ends, so that is no rare case: rounding must not decide it.
    """
    along = wire.ends - wire.starts  # (links, 3)
    length2 = np.maximum(np.sum(along**2, axis=1), 1e-300)
    offset = points[:, None, :] - wire.starts  # (p, links, 3)
    with np.errstate(over="ignore", invalid="ignore"):  # of a point too far away for its square
        t = np.clip(np.sum(offset * along, axis=2) / length2, 0.0, 1.0)
        distance2 = np.sum((offset - t[..., None] * along) ** 2, axis=2)
        nearest = distance2 <= (1.0 + 1e-9) * np.min(distance2, axis=1, keepdims=True) + 1e-18
    return np.argmax(nearest, axis=1)


def _as_floats(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """`value` as a float64 array of its own; real numbers only: no text, no bool, nothing complex, None or masked."""
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
