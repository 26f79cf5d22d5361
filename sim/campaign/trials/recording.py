"""One run of one controller through one encounter, tick by tick: the general way, for any controller.

The robot follows perfectly: measured at tick k is what tick k - 1 asked for; or with a servo's lag.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.controller import SafetyController
from qpsafe.reference import JointReference
from qpsafe.sim.campaign.opponents.registry import NOTHING, SPOTS
from qpsafe.sim.campaign.trials.servo import DT, Servo
from qpsafe.tick import BAD_INPUT, DEGRADED, FAULT, OK

if TYPE_CHECKING:
    from qpsafe.sim.campaign.opponents.registry import Opponent
    from qpsafe.sim.campaign.trials.senses import Senses
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.tick import Tick

Array = NDArray[np.float64]

STATUSES = (OK, DEGRADED, BAD_INPUT, FAULT)
_NOBODY = np.empty((0, 3))
Observer = Callable[[int, Array, "Tick"], None]


class Recording(NamedTuple):
    """T ticks of n joints.

    Attributes:
        dt: Tick [s].
        q, qd: Measured (T, n) [rad, rad/s].
        reference_q, reference_qd: References (T, n).
        phase: ``following``, ``suspended`` or ``recovering`` (T,).
        path_time: Clock of the path (T,) [s].
        status: Number in `STATUSES` (T,).
        points: What was seen at each tick (p, 3) [m].
    """

    dt: float
    q: Array
    qd: Array
    reference_q: Array
    reference_qd: Array
    phase: NDArray[np.str_]
    path_time: Array
    status: NDArray[np.int64]
    points: list[Array]


def record(
    station: Station, entry: Opponent, senses: Senses, ticks: int, lag: float = 0.0, observer: Observer | None = None
) -> Recording:
    """Run one controller.

    Args:
        station: What the robot does where.
        entry: The controller.
        senses: What it is told, fresh.
        ticks: T.
        lag: Of the servo [s].
        observer: Called after every tick with its number, the measured position (n,) [rad] and what was answered.
    """
    # who is told where everybody is, or nothing, waits for no images
    controls, n = entry.make(station if entry.sight == SPOTS else station.without_images), station.robot.nq
    servo = Servo(station.start, lag)
    run = np.empty((4, ticks, n))
    path_time, status = np.empty(ticks), np.empty(ticks, dtype=np.int64)
    # a field adds up what it is told, a monitor takes the worst of it
    told = senses.nearest if isinstance(controls, SafetyController) else senses.everywhere
    phases, points = [], []
    for k in range(ticks):
        q, qd = servo.q, servo.qd
        if entry.sight == NOTHING:
            tick = controls.step(q, qd, points=_NOBODY)
        elif entry.sight == SPOTS:
            tick = controls.step(q, qd, **senses.told(q, k))
        else:
            tick = controls.step(q, qd, points=told(q, k))
        reference, number = tick.reference, STATUSES.index(tick.status)
        if not (np.isfinite(reference.q).all() and np.isfinite(reference.qd).all()):  # nothing moves on such a thing
            reference, number = JointReference(k, k * DT, q, np.zeros(n)), STATUSES.index(FAULT)
        clock = float(tick.path_time)
        if not np.isfinite(clock):  # nor does work go on: the path waits
            clock, number = float(path_time[k - 1]) if k else 0.0, STATUSES.index(FAULT)
        run[0, k], run[1, k], run[2, k], run[3, k] = q, qd, reference.q, reference.qd
        path_time[k], status[k] = clock, number
        phases.append(tick.phase)
        points.append(np.concatenate((tick.points, tick.near)) if len(tick.near) else tick.points)
        if observer is not None:
            observer(k, q, tick)
        servo.follow(reference.q, reference.qd)
    return Recording(DT, run[0], run[1], run[2], run[3], np.array(phases), path_time, status, points)
