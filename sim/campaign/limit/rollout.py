"""Joint motion towards goals, one after the other, as fast as the limits allow: compiled.

Whatever the goals, what comes out obeys the limits: every velocity is brought inside the box of its tick.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

import qpsafe.limits
from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import entry
from qpsafe.compiled.memory import view
from qpsafe.limits import box_into, stopping_speed
from qpsafe.sim.campaign.trials import servo
from qpsafe.sim.campaign.trials.servo import DT, served

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_two = types.Array(types.float64, 2, "C", readonly=True)
_ints = types.Array(types.int64, 1, "C", readonly=True)


@entry(
    types.void(
        _two, _ints, _two, types.float64, types.int64, types.int64,
        types.float64[:, :, ::1], types.float64[:, ::1], types.int64[:, ::1],
    ),
    qpsafe.limits, servo, compiled,
)  # fmt: skip
def roll_out(
    goals: Array, since: Index, limits: Array, return_speed: float, first: int, delay: int,
    runs: Array, bounds: Array, kinds: Index,
) -> None:  # fmt: skip
    """Fill a run from a tick on: the references from `first` on, what is measured from the tick after it on.

    Every joint goes for its goal at the largest speed from which it can still stop there, v = sign(e) stop(|e|), e from
    the last command, and v inside lower <= v <= upper of `JointLimits.box`.

    Args:
        goals: Joint positions (g, n) [rad].
        since: Tick from which on each is the goal, the first one `first`, (g,).
        limits: `JointLimits.table` (4, n).
        return_speed: Of the same limits [rad/s].
        first: Tick of the first command.
        delay: Of the servo, in ticks; 0 for perfect following.
        runs: Measured q and q̇, reference q and q̇ (4, T, n), known up to `first`.
        bounds, kinds: To work in, (2, n) and (3, n).
    """
    ticks, n, g = runs.shape[1], runs.shape[2], 0
    for k in range(first, ticks):
        # before the first command of all the robot stands where it is measured
        last, speed = (2 * ticks + k - 1) * n if k > 0 else 0, (3 * ticks + k - 1) * n if k > 0 else ticks * n
        q, qd = view(runs, last, (n,)), view(runs, speed, (n,))
        box_into(
            q, qd, view(limits, 0, (n,)), view(limits, n, (n,)), view(limits, 2 * n, (n,)), view(limits, 3 * n, (n,)),
            DT, return_speed, bounds, kinds,
        )  # fmt: skip
        while g + 1 < since.shape[0] and k >= since[g + 1]:
            g += 1
        for j in range(n):
            e = goals[g, j] - q[j]
            v = stopping_speed(abs(e), limits[3, j], DT)
            v = min(max(v if e > 0.0 else -v, bounds[0, j]), bounds[1, j])
            runs[2, k, j], runs[3, k, j] = q[j] + v * DT, v
        if k + 1 < ticks:
            served(runs, k, delay)
