"""The first half of a tick: from what was measured to the danger and the velocity that evades it.

    distances --(7), sensing rules--> points --(1)-(6)--> danger vectors --(8), (14), (15)--> torque --(16)--> q̇0

`sense` says it in plain words, for fields, sensors and evasions of any kind; `QuickSense` computes the same.
"""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.evasion import Evasion
from qpsafe.danger.field import DangerField
from qpsafe.danger.push import push
from qpsafe.sense_kernel import sense_quickly, work_size
from qpsafe.sensing.detection import BadInput, as_detection, as_joint_position, as_joint_velocity, plausible
from qpsafe.sensing.health import CLEAR
from qpsafe.sensing.sensing import DistanceSensing

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]
_FLOAT = np.dtype(np.float64)


class Sensed(NamedTuple):
    """What a tick knows of the danger.

    Attributes:
        points: Points that count (p, 3), world frame [m].
        links: Wire link of each (p,).
        vectors: Danger vectors (6) at them (p, 3).
        cdf_n: The largest danger.
        qd0: Evasive velocity q̇0 (n,) [rad/s].
        notes: What is wrong with the sensors, in words.
        capped: Whether the robot has to go slowly, since a sensor is dead.
        danger: CDF at the points (p,); None where nobody needs it.
        measured: The robot as measured; None likewise.
    """

    points: Array
    links: NDArray[np.int64]
    vectors: Array
    cdf_n: float
    qd0: Array
    notes: tuple[str, ...]
    capped: bool
    danger: Any = None
    measured: Any = None


def sense(
    robot: Robot,
    q: ArrayLike,
    qd: ArrayLike,
    distances: ArrayLike | None,
    points: ArrayLike | None,
    ages: ArrayLike | None,
    sensing: DistanceSensing | None,
    field: Any,
    evasion: Evasion,
) -> Sensed:
    """One step after the other; arguments as for `SafetyController` and its `step`.

    Raises:
        BadInput: What cannot be used.
    """
    measured = robot.at(as_joint_position(q, robot))
    wire = measured.wire(as_joint_velocity(qd, robot))

    # spot distances -> detected points (7), without known obstacles and the robot itself, lost ones held
    seen = as_detection(measured, wire, sensing, distances, points, ages)

    # danger (1)-(6); its vectors summed per link (8), as virtual torque (14), (15), as evasive velocity (16)
    danger, vectors, torque, cdf_n = push(field, measured, wire, seen.points, seen.links, seen.velocities)
    check_danger(cdf_n)
    qd0 = evasion.step(torque).copy()
    return Sensed(seen.points, seen.links, vectors, cdf_n, qd0, seen.notes, seen.capped, danger, measured)


def check_danger(cdf_n: float) -> None:
    """Refuse danger that is not finite.

    Raises:
        BadInput: It is not.
    """
    if not isfinite(cdf_n):  # never into the filter, which remembers
        raise BadInput("the danger of a detected point is not finite: joint values or points are out of all bounds")


class QuickSense:
    """`sense` in one compiled call, for readings of a robot's own sensors.

    Args:
        robot: The robot.
        sensing: Its distance sensors.
        field: The danger field.
        evasion: The admittance.
    """

    def __init__(self, robot: Robot, sensing: DistanceSensing, field: DangerField, evasion: Evasion) -> None:
        self._sensing, self._evasion = sensing, evasion
        self._shapes, self._spots = (robot.nq,), (len(sensing.spots),)
        self._body = (np.array(plausible(robot)), *robot.tree, *robot.wire_indices)
        self._weights = field.static, field.kinetic, field.gamma, field.floor
        work = np.empty(work_size(robot.memory, robot.nq, len(robot.wire_frames), len(sensing.spots)))
        self._work = robot.memory, work

    @staticmethod
    def fits(sensing: Any, field: Any, evasion: Any) -> bool:
        """Whether everything is of the kind that the compiled call knows."""
        return type(sensing) is DistanceSensing and type(field) is DangerField and type(evasion) is Evasion

    def __call__(self, q: Any, qd: Any, distances: Any, ages: Any) -> Sensed | None:
        """Sense one tick; None where something is unusual, which `sense` then names: nothing has been touched.

        Raises:
            BadInput: Too many spots out of order, or danger that is not finite.
        """
        if not (
            type(q) is type(qd) is type(distances) is np.ndarray and q.dtype is qd.dtype is distances.dtype is _FLOAT
        ):
            return None
        if not (q.shape == qd.shape == self._shapes and distances.shape == self._spots):
            return None
        sensing, evasion, k = self._sensing, self._evasion, len(distances)
        if ages is None:
            ages = sensing.fresh
        elif not (type(ages) is np.ndarray and ages.dtype is _FLOAT and ages.shape == self._spots):
            return None
        points, links, vectors, qd0 = np.empty((k, 3)), np.empty(k, np.int64), np.empty((k, 3)), np.empty(len(q))
        count, dead, out, cdf_n = sense_quickly(
            q, qd, distances, ages, *self._body, *sensing.tables, *sensing.memory, *self._weights,
            *evasion.matrices, evasion.velocity, *self._work, points, links, vectors, qd0,
        )  # fmt: skip
        if count < 0:
            return None
        severity, too_many, notes = sensing.take(dead, out)
        if too_many:
            raise BadInput("; ".join(notes))
        check_danger(cdf_n)
        evasion.velocity = qd0
        return Sensed(points[:count], links[:count], vectors[:count], cdf_n, qd0.copy(), notes, severity != CLEAR)
