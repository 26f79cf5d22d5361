"""References that never jump: seeded at a measured pose, blended in, tracked and braked within the joints' limits."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from qpsafe.limits import JointLimits, stopping_speed

Array = NDArray[np.float64]


class Shaper:
    """The reference that is sent, one tick at a time.

    Once seeded, every step keeps |q̇| <= v_max, |Δq̇| <= a_max dt and q = last q + q̇ dt, whatever it is asked to follow.

    Args:
        limits: Of the joints, with the tick dt.
        ramp_in: Time of blending in [s].
        ramp_out: Shortest time of braking [s].
        catch_up: Highest speed to make up for a distance to the source, as a fraction of v_max.

    Attributes:
        q, qd: Reference of the last tick (n,) [rad, rad/s].
        weight: How far the source is blended in, 0 to 1.
        clipped: Whether the last step could not do as asked.
    """

    def __init__(self, limits: JointLimits, ramp_in: float, ramp_out: float, catch_up: float) -> None:
        self.limits = limits
        self.dt = limits.dt
        self._ticks_in = max(1, math.ceil(ramp_in / self.dt))
        self._ticks_out = max(1, math.ceil(ramp_out / self.dt))
        self._most = catch_up * limits.max_velocity
        self.seed(np.zeros_like(limits.lower))
        self.settle(np.ones_like(limits.lower))  # compiled now, not while a robot waits
        self.seed(np.zeros_like(limits.lower))

    def seed(self, q: Array) -> None:
        """Start anew at rest at q (n,) [rad]."""
        self.q, self.qd = q.copy(), np.zeros_like(q)
        self._seed = self.q
        self._tick, self._braking, self.weight, self.clipped = 0, 0, 0.0, False

    def follow(self, q: Array, qd: Array) -> None:
        """One tick along a source that was at q - q̇ dt and goes to q with q̇; finite, (n,) [rad, rad/s].

        Blended with w from 0 to 1: the target seed + w (q - seed), and its velocity over this tick, exactly.
        """
        before = self.weight
        self._tick = min(self._tick + 1, self._ticks_in)
        self.weight = w = _smooth(self._tick / self._ticks_in)
        target = self._seed + w * (q - self._seed)
        velocity = before * qd + (w - before) / self.dt * (q - self._seed)
        self._braking = 0
        self._move(velocity + self._approach(target - velocity * self.dt - self.q))

    def settle(self, q: Array) -> None:
        """One tick at rest or on the way to a pose (n,) [rad], slowly."""
        self._braking = 0
        self._move(self._approach(q - self.q))

    def brake(self) -> bool:
        """One tick towards standstill, all joints in proportion; whether it is reached."""
        if not self._braking:  # long enough for the joint that takes longest
            slowest = float((np.abs(self.qd) / (self.limits.max_acceleration * self.dt)).max(initial=0.0))
            self._braking = max(self._ticks_out, math.ceil(slowest)) if slowest > 0.0 else 1
        self._braking -= 1
        box = self.limits.box(self.q, self.qd)
        wanted = self.qd * (self._braking / (self._braking + 1))
        # inside the box, but not back into the position limits: at rest is at rest
        self.qd = np.clip(box.clip(wanted), np.minimum(self.qd, 0.0), np.maximum(self.qd, 0.0))
        self.q = self.q + self.qd * self.dt
        self.clipped = False
        return not self.qd.any()

    def _approach(self, distance: Array) -> Array:
        """Speed to make up for a distance that can still be braked by half the acceleration."""
        speed = np.zeros_like(distance)
        for i, s in enumerate(distance.tolist()):
            if abs(s) > 1e-12:  # else it is there, but for rounding
                fastest = stopping_speed(abs(s), 0.5 * self.limits.max_acceleration[i], self.dt)
                speed[i] = math.copysign(min(fastest, self._most[i]), s)
        return speed

    def _move(self, qd: Array) -> None:
        box = self.limits.box(self.q, self.qd)
        self.qd = box.clip(qd)
        self.q = self.q + self.qd * self.dt
        self.clipped = not (np.abs(self.qd - qd) <= 1e-9).all()


def _smooth(s: float) -> float:
    """3 s² - 2 s³: from 0 to 1, at rest at both ends."""
    return s * s * (3.0 - 2.0 * s)
