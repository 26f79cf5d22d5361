"""Joints in a trial: they follow a reference at once, or as joints of second order behind a delay; how they stop."""

from __future__ import annotations

from math import exp
from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import entry, inline, readable
from qpsafe.compiled.memory import view

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

DT = 0.004  # of a trial's ticks [s]
OMEGA = 100.0  # natural frequency of joints with a lag, critically damped; the plant's own [rad/s]


@inline
def follow(q: Array, qd: Array, goal: Array, speed: Array, omega: float, dt: float, after: Array, rate: Array) -> None:
    """Joints a tick later, on their way to a reference that is at `goal` then and moves at `speed`; for compiled code.

    q'' = ω² (r - q) + 2 ω (r' - q'), solved exactly over the tick.

    Args:
        q, qd: Now (n,).
        goal, speed: Reference at the end of the tick (n,).
        omega: ω [rad/s].
        dt: Tick [s].
        after, rate: Filled with q, q' at its end (n,).
    """
    decay = exp(-omega * dt)
    for j in range(q.shape[0]):
        e, de = q[j] - (goal[j] - speed[j] * dt), qd[j] - speed[j]
        c = de + omega * e
        after[j] = goal[j] + decay * (e + c * dt)
        rate[j] = speed[j] + decay * (c - omega * (e + c * dt))


@inline
def served(runs: Array, k: int, delay: int) -> None:
    """Where the joints are a tick later, for compiled code: fills row k + 1 of the measured.

    Args:
        runs: Measured q and q̇, reference q and q̇ (4, T, n); contiguous, known up to row k.
        k: The tick.
        delay: Ticks between a reference and its use; 0 for perfect following.
    """
    ticks, n = runs.shape[1], runs.shape[2]
    after, rate = view(runs, (k + 1) * n, (n,)), view(runs, (ticks + k + 1) * n, (n,))
    if delay == 0:
        for j in range(n):
            after[j], rate[j] = runs[2, k, j], runs[3, k, j]
    elif k < delay:
        for j in range(n):
            after[j], rate[j] = runs[0, k, j], runs[1, k, j]
    else:
        at = k - delay
        follow(
            view(runs, k * n, (n,)), view(runs, (ticks + k) * n, (n,)), view(runs, (2 * ticks + at) * n, (n,)),
            view(runs, (3 * ticks + at) * n, (n,)), OMEGA, DT, after, rate,
        )  # fmt: skip


_in, _out = readable(1), types.float64[::1]


@entry(types.void(_in, _in, _in, _in, types.float64, types.float64, _out, _out), compiled)
def _follow(
    q: Array, qd: Array, goal: Array, speed: Array, omega: float, dt: float, after: Array, rate: Array
) -> None:  # fmt: skip
    follow(q, qd, goal, speed, omega, dt, after, rate)


class Servo:
    """The joints of one robot.

    Args:
        q: Where they start (n,) [rad].
        lag: Delay between a reference and its use, in whole ticks [s]; 0 for perfect following.

    Attributes:
        q, qd: Where they are (n,) [rad, rad/s].
    """

    def __init__(self, q: Array, lag: float = 0.0) -> None:
        self.q, self.qd = q.copy(), np.zeros_like(q)
        self._delay = round(lag / DT)
        self._waiting: list[tuple[Array, Array]] = []

    def follow(self, q: Array, qd: Array) -> None:
        """Move for one tick.

        Args:
            q: Reference at the end of the tick (n,) [rad].
            qd: Its velocity (n,) [rad/s].
        """
        if self._delay == 0:
            self.q, self.qd = q, qd
            return
        self._waiting.append((q, qd))
        if len(self._waiting) > self._delay:
            after, rate = np.empty_like(q), np.empty_like(q)
            _follow(self.q, self.qd, *self._waiting.pop(0), OMEGA, DT, after, rate)
            self.q, self.qd = after, rate


def wire_speeds(robot: Robot, q: Array, qd: Array) -> Array:
    """Of the ends of the wire [m/s].

    Args:
        robot: The robot.
        q: Its position (n,) [rad].
        qd: Its velocity (n,) [rad/s].
    """
    wire = robot.wire(q, qd)
    return np.linalg.norm(np.vstack((wire.start_velocities, wire.end_velocities)), axis=1)


def stopped(robot: Robot, q: Array, qd: Array, dt: float = 0.004) -> float:
    """a_s = v²/(2 s) of the slowest stop among the points that move [m/s²].

    Args:
        robot: The robot.
        q: Its position (n,) [rad].
        qd: Its velocity (n,) [rad/s].
        dt: Tick [s].
    """
    speeds = wire_speeds(robot, q, qd)
    counted = speeds >= 0.5 * speeds.max()
    way, v, here = np.zeros_like(speeds), qd.copy(), q.copy()
    while np.abs(v).max() > 0.0:
        v = v - np.clip(v, -robot.max_acceleration * dt, robot.max_acceleration * dt)
        here = here + v * dt
        way += dt * wire_speeds(robot, here, v)
    return float((speeds[counted] ** 2 / (2.0 * way[counted])).min())
