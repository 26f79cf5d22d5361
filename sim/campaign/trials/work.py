"""What a run did for the work: progress, stops, how smooth, how true to its path; and whether it kept its limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.recovery.recovery import FOLLOWING, SUSPENDED

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.campaign.trials.recording import Recording
    from qpsafe.sim.campaign.trials.station import Station

Array = NDArray[np.float64]

TURNS = 0.02  # joint speed on both sides of zero that makes a change of direction a reversal [rad/s]
STANDS = 1e-3  # a robot whose joints are all slower, and whose path waits, is stopped [rad/s]
EVERY = 10  # ticks between two looks at the path error
SETTLING = 0.3  # after a return to the path its error still runs out [s]


class Work(NamedTuple):
    """Attributes as the columns of the same names in `qpsafe.sim.campaign.trials.rows`."""

    progress: float
    lost_time: float
    stops: int
    suspensions: int
    path_error: float
    reversals: int
    limit_excess: float
    bad_ticks: int


def work(run: Recording, station: Station) -> Work:
    """Measure a run.

    Args:
        run: Of a controller.
        station: Where it was.
    """
    nominal, done = station.nominal(len(run.q)), float(run.path_time[-1])
    standing = (np.abs(run.qd).max(axis=1) < STANDS) & (np.diff(run.path_time, prepend=0.0) == 0.0)
    return Work(
        progress=done / nominal if nominal > 0.0 else 1.0,
        lost_time=nominal - done,
        stops=_begun(standing) if station.program is not None else 0,
        suspensions=_begun(run.phase == SUSPENDED),
        path_error=_path_error(run, station),
        reversals=_reversals(run.reference_qd),
        limit_excess=_excess(run, station.robot),
        bad_ticks=int((run.status > 1).sum()),
    )


def _begun(during: NDArray[np.bool_]) -> int:
    """How often something began."""
    return int((np.diff(during.astype(np.int8), prepend=0) == 1).sum())


def _reversals(qd: Array) -> int:
    """How often joints turned round, all together; slower than `TURNS` is neither direction."""
    count = 0
    for column in qd.T:
        signs = np.sign(column[np.abs(column) > TURNS])
        count += int((np.diff(signs) != 0).sum())
    return count


def _path_error(run: Recording, station: Station) -> float:
    """Largest distance of the first tool from its reference while it follows, settled [m]; NaN if it never does."""
    following = run.phase == FOLLOWING
    since = np.arange(len(following)) - np.maximum.accumulate(np.where(following, -1, np.arange(len(following))))
    settled = np.flatnonzero(following & (since * run.dt > SETTLING))[::EVERY]
    frame, reference = station.robot.tool_frames[0], station.reference
    errors = [
        float(np.linalg.norm(station.robot.pose(frame, run.q[k])[:3, 3] - reference.sample(t).pose[:3, 3]))
        for k, t in zip(settled[1:], run.path_time[settled[1:] - 1], strict=True)  # q is what tick k - 1 asked for
    ]
    return max(errors, default=float("nan"))


def _excess(run: Recording, robot: Robot) -> float:
    """By how much of it a limit of position, velocity or acceleration was passed at most; 0 if none was."""
    if not (np.isfinite(run.reference_q).all() and np.isfinite(run.reference_qd).all()):
        return math.inf
    steps = np.diff(run.reference_q, axis=0) / run.dt
    qdd = np.diff(run.reference_qd, axis=0, prepend=0.0) / run.dt
    over = (
        (np.abs(run.reference_qd) / robot.max_velocity).max() - 1.0,
        (np.abs(steps) / robot.max_velocity).max() - 1.0 - 1e-9,
        (np.abs(qdd) / robot.max_acceleration).max() - 1.0,
        (robot.lower - run.reference_q).max(),
        (run.reference_q - robot.upper).max(),
    )
    worst = float(max(over))
    return worst if worst > 1e-9 else 0.0
