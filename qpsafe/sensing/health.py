"""Which readings can be believed. The one place that decides what makes a spot sick, dead, or the robot stop.

The table of reactions is in docs/sensing.md. A reading is sick if it is not a number, below zero, minus infinity (REP
117: too near to measure), stale, or stuck. +inf, and anything beyond the range, is healthy: nothing is in sight.
Non-finite values are found before any arithmetic is done with them; every comparison is written so that NaN fails it.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.danger.compiled import Array, entry, readable
from qpsafe.sensing.rules import SensingRules

HEALTHY, NOT_A_NUMBER, BELOW_ZERO, STALE, STUCK = range(5)
#: What is wrong, by code.
WORDS = ("healthy", "not a number", "below zero", "stale", "stuck")

#: Severity: all spots see; some are dead and the speed is capped; too many are dead and the robot stops.
CLEAR, CAPPED, STOPPED = "clear", "capped", "stopped"


class SpotHealth:
    """Health of every spot over time.

    Severity only rises: a dead spot stays dead, and a stop a stop, until `acknowledge`, even if readings come again.

    Args:
        count: Number of spots.
        rules: Times and shares.
        dt: Tick [s].

    Attributes:
        codes: What is wrong with each spot's reading in this tick, (k,).
        dead: Which spots have been without a usable reading for `dead_after`, (k,).
        stopped: Whether too many were dead at the same time.
    """

    def __init__(self, count: int, rules: SensingRules, dt: float) -> None:
        self._stuck_ticks = max(rules.ticks(rules.stuck_after, dt), 3)
        self._dead_ticks = max(rules.ticks(rules.dead_after, dt), 1)
        self._max_age, self._motion = rules.max_age, rules.stuck_motion
        self.most = int(np.floor(rules.dead_share * count + 1e-9))
        self._count = count
        self.reset()

    def reset(self) -> None:
        """Forget everything, what was acknowledged or not."""
        k = self._count
        self.codes: NDArray[np.int64] = np.zeros(k, dtype=np.int64)
        self.dead: NDArray[np.bool_] = np.zeros(k, dtype=np.bool_)
        self.stopped = False
        self._tally = np.zeros(2, dtype=np.int64)  # spots that are dead; that are unusable or dead, in this tick
        self._out = 0  # spots that are unusable or dead in this tick
        self._sick = np.zeros(k, dtype=np.int64)  # ticks without a usable reading, up to now
        self._same = np.zeros(k, dtype=np.int64)  # ticks with the same reading, up to now
        self._last = np.full(k, np.nan)
        self._anchor = np.zeros((k, 3))  # the point it meant at first

    def acknowledge(self) -> None:
        """Let spots that work again work, and the robot move if enough of them do."""
        self.dead = self._sick >= self._dead_ticks
        self.stopped = int(self.dead.sum()) > self.most
        self._out = int((self.dead | (self.codes != HEALTHY)).sum())

    def update(self, distances: Array, ages: Array, origins: Array, directions: Array) -> None:
        """Take one tick's readings.

        Args:
            distances: Readings (k,) [m].
            ages: How old they are (k,) [s].
            origins: Of the spots now (k, 3) [m].
            directions: Of the spots now (k, 3).
        """
        _classify(
            distances,
            ages,
            origins,
            directions,
            self._max_age,
            self._stuck_ticks,
            self._motion,
            self._dead_ticks,
            self._last,
            self._same,
            self._anchor,
            self.codes,
            self._sick,
            self.dead,
            self._tally,
        )
        self._out = int(self._tally[1])
        self.stopped |= bool(self._tally[0] > self.most)

    @property
    def severity(self) -> str:
        """`clear`, `capped` or `stopped`."""
        return STOPPED if self.stopped else CAPPED if self.dead.any() else CLEAR

    @property
    def too_many(self) -> bool:
        """Whether too many spots are unusable or dead, now or since the last acknowledgement."""
        return self.stopped or self._out > self.most

    @property
    def out_of_order(self) -> NDArray[np.intp]:
        """Indices of the spots whose sector nobody sees: unusable in this tick, or dead."""
        return (self.dead | (self.codes != HEALTHY)).nonzero()[0] if self._out else np.empty(0, dtype=np.intp)


_INTS = types.int64[::1]


@entry(
    types.void(
        readable(1),
        readable(1),
        readable(2),
        readable(2),
        types.float64,
        types.int64,
        types.float64,
        types.int64,
        types.float64[::1],
        _INTS,
        types.float64[:, ::1],
        _INTS,
        _INTS,
        types.boolean[::1],
        _INTS,
    )
)
def _classify(
    distances: Array,
    ages: Array,
    origins: Array,
    directions: Array,
    max_age: float,
    stuck_ticks: int,
    motion: float,
    dead_ticks: int,
    last: Array,
    same: Array,
    anchor: Array,
    codes: Array,
    sick: Array,
    dead: Array,
    tally: Array,
) -> None:
    """Fill codes, count sick ticks, let the dead die; tally how many are dead, and how many dead or unusable."""
    count = out = 0
    for i in range(distances.shape[0]):
        d = distances[i]
        if d != d:
            codes[i] = NOT_A_NUMBER
        elif not d >= 0.0:  # -inf too
            codes[i] = BELOW_ZERO
        elif not ages[i] <= max_age:  # an age that is not a number is stale
            codes[i] = STALE
        else:
            codes[i] = HEALTHY
        # stuck: the same bits tick after tick, while the point they mean is carried along by the robot
        if 0.0 <= d < np.inf:
            moved = 0.0
            for j in range(3):
                point = origins[i, j] + d * directions[i, j]
                if d != last[i]:
                    anchor[i, j] = point
                moved += (point - anchor[i, j]) ** 2
            same[i] = same[i] + 1 if d == last[i] else 1
            last[i] = d
            if same[i] >= stuck_ticks and moved >= motion * motion and codes[i] == HEALTHY:
                codes[i] = STUCK
        else:
            same[i], last[i] = 0, np.nan
        sick[i] = 0 if codes[i] == HEALTHY else sick[i] + 1
        if sick[i] >= dead_ticks:
            dead[i] = True
        count += dead[i]
        out += dead[i] or sick[i] > 0
    tally[0], tally[1] = count, out
