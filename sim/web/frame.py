"""What a loop tells its page, some thirty times a second: the newest tick, and the worst since the last frame."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from qpsafe.sim.web.setup import Setup
    from qpsafe.tick import Tick

Array = NDArray[np.float64]

EVERY = 8  # ticks of 4 ms between two frames
NO_POSES, NO_TIMES = np.empty((0, 7)), np.empty((0, 2))


class Row(NamedTuple):
    """One point of the plots: the worst values since the point before, so that no event of a single tick is lost.

    Attributes:
        time: [s].
        cdf_n: The largest.
        m, f: The smallest.
        distance: The smallest true distance to people, boards included; NaN where it is not known [m].
        position: The largest error of the tasks' first half, which are positions [m].
        orientation: Likewise of the rest [rad].
    """

    time: float
    cdf_n: float
    m: float
    f: float
    distance: float
    position: float
    orientation: float


class Frame(NamedTuple):
    """A moment as a page shows it.

    Attributes:
        run: Number of the run; another one has another scene.
        tick: The newest.
        q: Measured joint position then (n,) [rad].
        people: Poses of the scene's mocap bodies: position, quaternion (b, 7).
        row: Of the plots.
        times: Of every tick since the frame before: of the controller, and from when it was due until all of it was
            done (k, 2) [s].
        period: From tick to tick on the wall clock [s].
        state: What the loop is doing, in a word.
        note: What went wrong with the last wish, in words; empty if nothing did.
        wish: Number of the newest wish that has been followed.
        since: Monotonic clock at the first tick that took it into account [s].
        setup: What is simulated; None where nothing is.
        qpos: State of the whole scene, where more than robot and people moves.
    """

    run: int
    tick: Tick
    q: Array
    people: Array
    row: Row
    times: Array = NO_TIMES
    period: float = 0.004
    state: str = ""
    note: str = ""
    wish: int = 0
    since: float = 0.0
    setup: Setup | None = None
    qpos: Array | None = None


class Worst:
    """Keeps the worst of some ticks."""

    def __init__(self) -> None:
        self._rows: list[Row] = []

    def add(self, tick: Tick, distance: float = float("nan")) -> None:
        """Take a tick into account.

        Args:
            tick: The tick.
            distance: The true distance at it [m].
        """
        errors = [float(np.sqrt(error @ error)) for error in tick.errors]
        half = (len(errors) + 1) // 2
        position, orientation = max(errors[:half], default=np.nan), max(errors[half:], default=np.nan)
        self._rows.append(Row(tick.reference.time, tick.cdf_n, tick.m, tick.f, distance, position, orientation))

    def take(self) -> Row | None:
        """The worst of all ticks since the last call; None if there were none."""
        if not self._rows:
            return None
        rows, self._rows = np.array(self._rows), []
        high, low = np.fmax.reduce(rows), np.fmin.reduce(rows)
        time, _, _, _, _, position, orientation = high.tolist()
        cdf_n = float(rows[:, 1].max())  # not a number if it could not be told once
        m, f, distance = low[2:5].tolist()
        return Row(time, cdf_n, m, f, distance, position, orientation)


class Every:
    """Says whether a period has passed.

    Args:
        period: [s].
    """

    def __init__(self, period: float) -> None:
        self._period, self._last = period, -math.inf

    def __call__(self) -> bool:
        """Whether the period has passed since this was last true."""
        now = time.monotonic()
        if now - self._last < self._period:
            return False
        self._last = now
        return True
