"""How an IRC5 under EGM turns references into motion: its motion law, low pass and limits, all joints at once.

    speed = low pass [k (pos_ref - pos) + speed_ref],   |speed| <= MaxSpeedDeviation,   pos += speed dt

pos is the controller's own planned position, which the servo follows after the control lag. The last reference is
used until another one comes: a lost answer lets pos run on to pos_ref + speed_ref / k, no farther.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EgmSettings:
    """What a RAPID program sets with EGMSetupUC, EGMActJoint and EGMRunJoint.

    The defaults are those of examples/rapid, but for a longer `comm_timeout`, a `cond_time` that never ends, and no
    `ramp_in`: they hide least of what the streamer does.

    Attributes:
        gain: k, the default proportional position gain, 0 to 20 [1/s].
        lowpass: Bandwidth of the low pass, 0 to 100, 0 for none [Hz].
        max_speed_deviation: Largest joint speed that references can ask for [rad/s]; RAPID's default is 1 deg/s.
        comm_timeout: How long the robot goes without an answer before ERR_UDPUC_COMM [s].
        cond_band: Distance of every joint to its reference that counts as converged [rad].
        cond_time: For how long, before EGMRunJoint returns and the program runs it anew; infinite: never [s].
        ramp_in: RampInTime: the time in which corrections come to full effect [s].
        lag: Control lag between plan and servo [s].
        retry: How long RAPID's error handler takes to start EGM anew after ERR_UDPUC_COMM; infinite: never [s].
    """

    gain: float = 5.0
    lowpass: float = 20.0
    max_speed_deviation: float = math.radians(450.0)
    comm_timeout: float = 1.0
    cond_band: float = math.radians(0.5)
    cond_time: float = math.inf
    ramp_in: float = 0.0
    lag: float = 0.012
    retry: float = 1.0

    def __post_init__(self) -> None:
        ranges = {"gain": 20.0, "lowpass": 100.0, "max_speed_deviation": 100.0, "lag": 0.1, "comm_timeout": 100.0}
        for item in fields(self):
            value, most = getattr(self, item.name), ranges.get(item.name, math.inf)
            if not (isinstance(value, int | float) and 0.0 <= value <= most):
                raise ConfigurationError("EgmSettings", item.name, value, f"0 to {most:g}")
        for name in ("max_speed_deviation", "comm_timeout"):
            if not getattr(self, name) > 0.0:
                raise ConfigurationError("EgmSettings", name, getattr(self, name), "more than 0")


class MotionLaw:
    """The motion law of one run of EGMRunJoint.

    Args:
        settings: Of EGM.
        dt: Cycle [s].
        q: Where the robot stands (n,) [rad].
    """

    def __init__(self, settings: EgmSettings, dt: float, q: Array) -> None:
        self.settings, self.dt = settings, dt
        self._alpha = 1.0 - math.exp(-2.0 * math.pi * settings.lowpass * dt) if settings.lowpass > 0.0 else 1.0
        self.start(q)

    def start(self, q: Array) -> None:
        """Begin at rest at q (n,) [rad]: no reference yet, corrections not ramped in, not converged."""
        self.q, self.qd = q.copy(), np.zeros_like(q)
        self._reference = q.copy(), np.zeros_like(q)
        self._time = self.settled = 0.0
        self.converged = False

    def halt(self) -> None:
        """Stand still where the plan is, e.g. with the motors off; the reference stays what it is."""
        self.qd = np.zeros_like(self.q)

    def refer(self, q: Array, qd: Array) -> None:
        """Take a reference (n,), (n,) [rad, rad/s], used until the next one."""
        self._reference = q, qd

    def step(self) -> tuple[Array, Array]:
        """Plan one cycle; the position now and the speed during the cycle (n,) [rad, rad/s]."""
        settings, (q_ref, qd_ref) = self.settings, self._reference
        wanted = settings.gain * (q_ref - self.q) + qd_ref
        if settings.ramp_in > 0.0:
            wanted = min(self._time / settings.ramp_in, 1.0) * wanted
        self.qd = self.qd + self._alpha * (wanted - self.qd)
        self.qd = np.clip(self.qd, -settings.max_speed_deviation, settings.max_speed_deviation)
        start = self.q
        self.q = self.q + self.dt * self.qd
        self._time += self.dt
        near = bool((np.abs(q_ref - self.q) <= settings.cond_band).all())
        self.settled = self.settled + self.dt if near else 0.0
        self.converged = self.settled >= settings.cond_time
        return start, self.qd
