"""A simulated IRC5 with EGM, one cycle at a time: no sockets and no clock in here, so that every fault can be repeated.

A cycle of a real controller is `advance`, `receive` what arrived, `packet`: an answer acts one cycle after the packet
that it answers. In lock-step it is `packet`, `receive`, `advance`: the robot waits for the answer.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.irc5.messages import WRAP, MalformedPacket, RobotPacket, SensorPacket, decode_sensor
from qpsafe.irc5.transport.axes import Axes, axes_of
from qpsafe.sim.irc5.motion import EgmSettings, MotionLaw

Array = NDArray[np.float64]


class Body(Protocol):
    """What the controller's servos move: a `qpsafe.sim.world.plant.Plant`, or `IdealBody`."""

    @property
    def q(self) -> Array:
        """Measured joint positions (n,) [rad]."""

    def apply(self, q_ref: Array, qd_ref: Array) -> bool:
        """Take position now and speed from now on."""

    def advance(self) -> None:
        """Move on by one cycle."""


class IdealBody:
    """A robot that is where it should be, a few cycles late: no MuJoCo, for runs by the thousand.

    Args:
        q: Where it stands (n,) [rad].
        lag: Control lag, rounded to whole cycles [s].
        dt: Cycle [s].
    """

    def __init__(self, q: Array, lag: float = 0.012, dt: float = 0.004) -> None:
        self._dt = dt
        self._ends: deque[Array] = deque([q.copy()] * round(lag / dt))
        self.q = q.copy()

    def apply(self, q_ref: Array, qd_ref: Array) -> bool:
        """Take position now and speed from now on."""
        self._ends.append(q_ref + self._dt * qd_ref)
        return True

    def advance(self) -> None:
        """Move on by one cycle."""
        if self._ends:
            self.q = self._ends.popleft()


@dataclass
class Counts:
    """What the robot's end of the wire saw.

    Attributes:
        sent: Packets sent while EGM ran.
        answered: Cycles with an answer.
        missed: Cycles without any answer: the last reference was used again.
        extra: Answers beyond one in a cycle.
        rejected: Datagrams that are no answer.
        timeouts: ERR_UDPUC_COMM.
        restarts: Times EGM was started anew.
        returns: Times EGMRunJoint returned because the robot had converged.
        limited: Cycles in which MaxSpeedDeviation cut a speed.
    """

    sent: int = 0
    answered: int = 0
    missed: int = 0
    extra: int = 0
    rejected: int = 0
    timeouts: int = 0
    restarts: int = 0
    returns: int = 0
    limited: int = 0


class SimulatedIrc5:
    """The controller: states, motion law, time limits.

    Args:
        body: What it moves.
        settings: Of EGM.
        dt: Cycle [s].
        axes: Which joints are external; by default those from the seventh on.

    Attributes:
        motors_on: Whether the motors are on.
        rapid: Whether the RAPID program runs.
        mci: Motion control: ``running``, ``stopped`` or ``error``.
        counts: What was seen.
        reference: The answer in use, None before the first.
        seq: Of the next packet.
    """

    SETUP = 0.02  # from the start of EGM until EGMRunJoint runs [s]

    def __init__(
        self, body: Body, settings: EgmSettings | None = None, dt: float = 0.004, axes: Axes | None = None
    ) -> None:
        self.body, self.dt = body, dt
        self.axes = axes_of(len(body.q)) if axes is None else axes
        self.settings = EgmSettings() if settings is None else settings
        self.law = MotionLaw(self.settings, dt, body.q)
        self.counts = Counts()
        self.time = 0.0
        self.motors_on = self.rapid = True
        self._start(0.0)

    def _start(self, pause: float) -> None:
        """RAPID runs EGMSetupUC, EGMActJoint and, after `pause` [s], EGMRunJoint."""
        self.seq = 0
        self.mci = "stopped"
        self.reference: SensorPacket | None = None
        self._run_at = self.time + pause + self.SETUP
        self._silence = 0.0
        self._silent_until = self.time + pause
        self.law.start(self.law.q)

    # what a person, or a fault, does to the robot

    def restart(self, pause: float = 0.0) -> None:
        """Start the RAPID program from its beginning: sequence numbers begin at 0 again.

        Args:
            pause: How long nothing is sent before [s].
        """
        self.counts.restarts += 1
        self.motors_on = self.rapid = True
        self._start(pause)

    def motors(self, on: bool) -> None:
        """Switch the motors; off stops the robot and the program where they are, on lets both go on."""
        self.motors_on = self.rapid = on
        self._hold(on)

    def program(self, runs: bool) -> None:
        """Stop the RAPID program, or let it go on where it was: corrections resume in the same state."""
        self.rapid = runs
        self._hold(runs)

    def _hold(self, goes_on: bool) -> None:
        self.law.halt()
        self._silence = 0.0
        if self.mci != "error":
            self.mci = "stopped"
            self._run_at = self.time if goes_on else math.inf

    # one cycle

    @property
    def sending(self) -> bool:
        """Whether packets go out now: not while RAPID recovers from a lost connection."""
        return self.time >= self._silent_until - 1e-9

    def packet(self) -> RobotPacket | None:
        """What to send in this cycle; None where nothing is sent."""
        if not self.sending:
            return None
        if self.mci == "stopped" and self.time >= self._run_at - 1e-9 and self.motors_on and self.rapid:
            self.mci = "running"
        seq, self.seq = self.seq, (self.seq + 1) % WRAP
        self.counts.sent += 1
        return RobotPacket(
            seq=seq,
            time_ms=round(1e3 * self.time) % WRAP,
            q=self.body.q,
            q_planned=self.law.q,
            motors_on=self.motors_on,
            mci=self.mci,
            rapid="running" if self.rapid else "stopped",
            converged=self.law.converged,
            clock=1e9 + self.time,
        )

    def receive(self, datagrams: Sequence[bytes]) -> SensorPacket | None:
        """Take what has arrived since the last cycle; the last answer among it is used, old or not.

        Args:
            datagrams: In the order of their arrival.

        Returns:
            The answer that is used from now on, None if there was none.
        """
        answers = []
        for data in datagrams:
            try:
                answers.append(decode_sensor(data, self.axes))
            except MalformedPacket:
                self.counts.rejected += 1
        self.take(answers)
        return answers[-1] if answers else None

    def take(self, answers: Sequence[SensorPacket]) -> None:
        """Use the last of the answers of this cycle."""
        counts = self.counts
        if not self.sending or self.seq == 0:
            return
        counts.extra += max(len(answers) - 1, 0)
        if not answers:
            counts.missed += 1
            self._silence += self.dt
            if self._silence >= self.settings.comm_timeout and self.mci == "running":
                self._lose()
            return
        self._silence = 0.0
        counts.answered += 1
        self.reference = answers[-1]
        self.law.refer(self.reference.q_ref, self.reference.qd_ref)  # also while it stands: it resumes in this state

    def _lose(self) -> None:
        """ERR_UDPUC_COMM: motion stops, RAPID's error handler starts anew, or the program ends."""
        self.counts.timeouts += 1
        self.law.halt()
        if self.settings.retry < math.inf:
            self.counts.restarts += 1
            self._start(self.settings.retry)
        else:
            self.mci, self.rapid = "error", False
            self._silent_until = math.inf

    def advance(self) -> None:
        """Move on by one cycle."""
        law, settings = self.law, self.settings
        if self.mci == "running" and self.motors_on and self.rapid:
            start, speed = law.step()
            self.counts.limited += bool((np.abs(speed) >= settings.max_speed_deviation).any())
            if law.converged:  # EGMRunJoint returns, the program runs it anew
                self.counts.returns += 1
                self.mci, self._run_at = "stopped", self.time + self.SETUP
                law.start(law.q)
                self.reference = None
        else:
            start, speed = law.q, np.zeros_like(law.q)
        self.body.apply(start, speed)
        self.body.advance()
        self.time += self.dt
