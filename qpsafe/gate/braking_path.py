"""The way a robot goes that takes one tick at a command and then brakes at its limits, in closed form, compiled.

References are ticks apart, joints go straight between them. With m = floor(|v|/(a dt)) full decrements of the speed,
joint j is after i ticks of braking at  q + s dt Σ_{l=0..k} (|v| - l a dt),  k = min(i, m),  s the sign of v.
"""

from __future__ import annotations

from math import ceil, floor, trunc

from qpsafe.compiled.compiled import Array, inline


@inline
def slow_down(qd: Array, acceleration: Array, dt: float, slower: Array) -> None:
    """The velocity qd (n,) [rad/s] a tick later, braked as hard as allowed: inside the box."""
    for j in range(qd.shape[0]):
        most = acceleration[j] * dt
        slower[j] = qd[j] - min(max(qd[j], -most), most)


@inline
def braked(v: float, a: float, dt: float, ticks: float) -> float:
    """Speed of a joint in tick number `ticks` (a whole number) after the command's: 0 is the command's own."""
    rest = abs(v) - ticks * a * dt
    return 0.0 if rest <= 0.0 else (rest if v > 0.0 else -rest)


@inline
def covered(v: float, a: float, dt: float, time: float) -> float:
    """How far a joint has gone after a time [s], for a command v, the tick of the command included."""
    whole = floor(time / dt)
    k = min(whole, floor(abs(v) / (a * dt)) + 1.0)  # ticks that are over
    way = k * abs(v) - 0.5 * k * (k - 1.0) * a * dt
    part = (time / dt - whole) * abs(braked(v, a, dt, whole)) if k == whole else 0.0
    way = (way + part) * dt
    return way if v > 0.0 else -way


@inline
def ticks_of(v: float, a: float, dt: float) -> int:
    """Ticks until a joint stands, for a command v: the command's own, and those it brakes in."""
    return trunc(ceil(abs(v) / (a * dt)))


@inline
def at_time(q: Array, v: Array, a: Array, dt: float, time: float, there: Array) -> None:
    """Joint position (n,) after a time on the way."""
    for j in range(q.shape[0]):
        there[j] = q[j] + covered(v[j], a[j], dt, time)
