"""Which readings can be believed. The one place that decides what makes a spot sick, dead, or the robot stop.

The table of reactions is in docs/reference/sensing.md. A reading is sick if it is not a number, below zero, minus
infinity (REP 117: too near to measure), stale, stuck, or of an impossible age: from the future, or older by more than
the time that has passed; the clock it was taken by is wrong, and cannot tell when the sensor falls silent. +inf, and
anything beyond the range, is healthy: nothing is in sight.

Non-finite values are found before any arithmetic is done with them; every comparison is written so that NaN fails it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, Vector, inline
from qpsafe.sensing.rules import SensingRules

HEALTHY, NOT_A_NUMBER, BELOW_ZERO, STALE, STUCK, IMPOSSIBLE_AGE = range(6)
#: What is wrong, by code.
WORDS = ("healthy", "not a number", "below zero", "stale", "stuck", "of an impossible age")

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
        self._most = int(np.floor(rules.dead_share * count + 1e-9))
        #: Columns: code of this tick, ticks without a usable reading up to now, ticks with the same reading.
        self.counts: NDArray[np.int64] = np.zeros((count, 3), dtype=np.int64)
        self.dead: NDArray[np.bool_] = np.zeros(count, dtype=np.bool_)
        #: Columns: the last reading, NaN for none; the point it meant at first; the largest possible age, NaN for any.
        self.seen = np.empty((count, 5))
        self.reset()

    def reset(self) -> None:
        """Forget everything, what was acknowledged or not."""
        self.counts[:] = 0
        self.dead[:] = False
        self.seen[:, (0, 4)], self.seen[:, 1:4] = np.nan, 0.0
        self.stopped = False
        self._dying = self._out = 0  # spots that are dead; that are unusable or dead in this tick

    def acknowledge(self) -> None:
        """Let spots that work again work, and the robot move if enough of them do."""
        self.dead[:] = self.counts[:, 1] >= self._dead_ticks
        self._dying = int(self.dead.sum())
        self.stopped = self._dying > self._most
        self._out = int((self.dead | (self.codes != HEALTHY)).sum())

    def take(self, dead: int, out: int) -> None:
        """Take how many spots are dead, and how many dead or unusable, in this tick; `judge` has seen every spot."""
        self._dying, self._out = dead, out
        self.stopped |= dead > self._most

    @property
    def ticks(self) -> tuple[int, int]:
        """After how many ticks a spot is stuck, and dead."""
        return self._stuck_ticks, self._dead_ticks

    @property
    def most(self) -> int:
        """How many spots may be unusable."""
        return self._most

    @property
    def codes(self) -> NDArray[np.int64]:
        """What is wrong with each spot's reading in this tick, (k,)."""
        return self.counts[:, 0]

    @property
    def severity(self) -> str:
        """`clear`, `capped` or `stopped`."""
        return STOPPED if self.stopped else CAPPED if self._dying else CLEAR

    @property
    def too_many(self) -> bool:
        """Whether too many spots are unusable or dead, now or since the last acknowledgement."""
        return self.stopped or self._out > self._most

    @property
    def any_out(self) -> bool:
        """Whether any spot is unusable in this tick, or dead."""
        return self._out > 0

    @property
    def out_of_order(self) -> NDArray[np.intp]:
        """Indices of the spots whose sector nobody sees: unusable in this tick, or dead."""
        return (self.dead | (self.codes != HEALTHY)).nonzero()[0] if self._out else np.empty(0, dtype=np.intp)


@inline
def judge(
    i: int,
    d: float,
    age: float,
    origin: Vector,
    direction: Vector,
    range_max: float,
    max_age: float,
    least: float,
    growth: float,
    motion: float,
    stuck_ticks: int,
    dead_ticks: int,
    counts: Array,
    seen: Array,
    dead: Array,
) -> int:
    """Code of spot i's reading d; counts sick ticks and declares spots dead. Arrays as in `SpotHealth`.

    An age is possible from `least` on, and up to `growth` more than in the last tick [s].
    """  # fmt: skip
    if d != d:
        code = NOT_A_NUMBER
    elif not d >= 0.0:  # -inf too
        code = BELOW_ZERO
    elif not age <= max_age:  # an age that is not a number is stale
        code = STALE
    elif age < least or age > seen[i, 4]:  # false where there was none
        code = IMPOSSIBLE_AGE
    else:
        code = HEALTHY
    seen[i, 4] = age + growth
    # stuck: the same bits tick after tick, while the point they mean is carried along by the robot
    if 0.0 <= d <= range_max:
        last, moved = seen[i, 0], 0.0
        for j in range(3):
            point = origin[j] + d * direction[j]
            if d != last:
                seen[i, 1 + j] = point
            moved += (point - seen[i, 1 + j]) ** 2
        counts[i, 2] = counts[i, 2] + 1 if d == last else 1
        seen[i, 0] = d
        if counts[i, 2] >= stuck_ticks and moved >= motion * motion and code == HEALTHY:
            code = STUCK
    else:
        counts[i, 2], seen[i, 0] = 0, np.nan
    counts[i, 0] = code
    counts[i, 1] = 0 if code == HEALTHY else counts[i, 1] + 1
    if counts[i, 1] >= dead_ticks:
        dead[i] = True
    return code
