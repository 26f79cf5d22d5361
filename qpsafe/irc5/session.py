"""One EGM session without its socket: datagrams in, one answer for each packet of the robot out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.cycle import Cycle, Phase
from qpsafe.irc5.messages import WRAP, RobotPacket, SensorPacket, encode_sensor
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.shaper import Shaper
from qpsafe.irc5.supervisor import cause_in_words
from qpsafe.irc5.transport.addresses import peer_address
from qpsafe.irc5.transport.axes import Axes, axes_of
from qpsafe.irc5.transport.inbox import Arrival, Inbox, Sender
from qpsafe.limits import JointLimits
from qpsafe.reference import JointReference
from qpsafe.text.given import of_kind, parts
from qpsafe.text.words import counted

Array = NDArray[np.float64]


class EgmSession:
    """Answers a robot, whatever it and its end of the wire do. Never raises in the loop.

    For each packet: `offer` the datagrams that arrived, `take` the cycle, `answer` it once. The robot's packets are the
    clock: one answer is one tick of the limits' dt.

    Args:
        limits: Of the joints; no answer that moves the robot goes beyond them, whatever the source of references does.
        rules: How to ramp, and what counts as wrong.
        peer: Address of the robot, or its name; by default that of the first valid packet.
        joint_names: For the reports.
        axes: Which joints are external; by default those from the seventh on.

    Attributes:
        phase: Now.
        causes: Why it stopped, until acknowledged.
        counts: What became of datagrams (see `Inbox`), and: ``answered``, ``superseded`` (dropped for a newer packet),
            ``late`` (not answered: the newest had waited unread for longer than the rules' silence),
            ``bad_reference`` (of the source: none, inactive or unusable; the robot brakes meanwhile), ``clipped``.
        q, qd: The reference last answered (n,) [rad, rad/s].

    Raises:
        ConfigurationError: Limits or rules are none, the peer has no address, or names or axes are not those of as many
            joints.
    """

    def __init__(
        self,
        limits: JointLimits,
        rules: SessionRules | None = None,
        peer: str | None = None,
        joint_names: Sequence[str] | None = None,
        axes: Axes | None = None,
    ) -> None:
        of_kind("EgmSession", "limits", limits, JointLimits)
        self.limits = limits
        self.rules = SessionRules() if rules is None else rules
        of_kind("EgmSession", "rules", self.rules, SessionRules)
        self.n = len(limits.lower)
        names = [f"joint_{i + 1}" for i in range(self.n)] if joint_names is None else joint_names
        self.names = parts("EgmSession", "joint_names", names, f"{self.n} names")
        if len(self.names) != self.n or not all(isinstance(name, str) for name in self.names):
            raise ConfigurationError("EgmSession", "joint_names", joint_names, f"{self.n} names")
        self.axes = axes_of(self.n) if axes is None else axes
        of_kind("EgmSession", "axes", self.axes, Axes)
        if self.axes.n != self.n:
            raise ConfigurationError("EgmSession", "axes", self.axes.n, f"axes of {counted(self.n, 'joint')}")
        known = None if peer is None else peer_address(peer, "EgmSession")
        self.inbox = Inbox(limits.lower, limits.upper, self.rules, known, self.axes)
        self.counts: Counter[str] = self.inbox.counts
        self.phase = Phase.WAITING
        self.causes: tuple[str, ...] = ()
        self._shaper = Shaper(limits, self.rules.ramp_in, self.rules.ramp_out, self.rules.catch_up)
        self._recent = np.zeros((max(1, round(self.rules.lag / limits.dt)), self.n))  # what was sent last, a ring
        self._arrival: Arrival | None = None
        self._waited = 0.0  # unread [s]
        self._anew, self._missed = False, 0
        self._cycle: Cycle | None = None
        self._before: RobotPacket | None = None
        self._source: JointReference | None = None  # the last one that was followed,
        self._ticks = 1  # and for how many ticks it has been the last one
        self._rest: Array | None = None
        self._seq, self._now = 0, 0.0
        self._relax = self._released = False

    @property
    def q(self) -> Array:
        """Position last answered (n,) [rad]."""
        return self._shaper.q

    @property
    def qd(self) -> Array:
        """Speed last answered (n,) [rad/s]."""
        return self._shaper.qd

    @property
    def at_rest(self) -> bool:
        """Whether the last answer leaves the robot standing."""
        return self.phase not in (Phase.RAMPING, Phase.RUNNING, Phase.STOPPING) and not self.qd.any()

    @property
    def sender(self) -> Sender | None:
        """Whom to answer: the robot's address and port, None before its first valid packet."""
        return self.inbox.sender

    def offer(self, data: bytes, sender: Sender, now: float, waited: float = 0.0) -> bool:
        """Take in a datagram. Returns whether it is the newest packet of the robot.

        Args:
            data: As received.
            sender: Its address.
            now: Monotonic clock [s].
            waited: How long it had waited unread [s].
        """
        self._now = now
        arrival = self.inbox.offer(data, sender, now - waited)
        if arrival is None:
            return False
        if self._arrival is not None:
            self.counts["superseded"] += 1
            self._missed += 1
        self._arrival, self._waited = arrival, waited
        self._anew |= arrival.restarted or bool(self._closed(arrival.packet))  # even if superseded
        self._missed = 0 if arrival.restarted else self._missed + arrival.missed
        return True

    def stop(self, cause: str) -> None:
        """Bring the robot to rest, and hold it until `acknowledge`."""
        self._released, cause = False, cause_in_words(cause)
        if cause not in self.causes:
            self.causes = (*self.causes, cause)
        if self.phase in (Phase.RAMPING, Phase.RUNNING):
            self.phase = Phase.STOPPING
        elif self.phase != Phase.STOPPING:
            self.phase = Phase.STOPPED

    def acknowledge(self) -> bool:
        """A person has seen to the cause of the stop: once the robot is at rest, references are ramped in again.

        Returns:
            Whether there was anything to acknowledge: False before it is stopped.
        """
        if self.phase != Phase.STOPPED:
            return False
        self.causes, self._released = (), True
        return True

    def take(self) -> Cycle | None:
        """The cycle of the newest packet, once; None if none has arrived.

        One that had waited for longer than the rules' silence is as good as none, but for a robot's very first.
        """
        arrival, self._arrival = self._arrival, None
        if arrival is None:
            return None
        waited = self._waited
        if waited > self.rules.silence and self.counts["answered"]:
            self.counts["late"] += 1
            return None
        anew, missed = self._anew, self._missed
        self._anew, self._missed = False, 0
        packet = arrival.packet
        qd = np.zeros(self.n) if arrival.restarted else self._velocity(packet)
        self._before = packet
        notes = [f"{counted(missed, 'packet')} missed"] if missed else []
        notes += [f"it had waited unread for {waited:.3g} s"] if waited > self.rules.lag else []

        closed = self._closed(packet)
        if self._released and not self.qd.any():
            self.phase, self._released = Phase.HOLDING, False
        seeded = anew or self.phase in (Phase.WAITING, Phase.HOLDING)
        deviation = np.zeros(self.n)
        if seeded:
            self._seed(packet.q)
            stopped = self.phase in (Phase.STOPPING, Phase.STOPPED)
            self.phase = Phase.STOPPED if stopped else Phase.HOLDING if closed else Phase.RAMPING
            notes += closed + (["the robot started anew"] if arrival.restarted else [])
        else:
            self._ticks += missed
            if missed:  # it went on at the last speed for as long as nothing else arrived
                self._remember(self.q + self.qd * min(missed * self.limits.dt, self.rules.lag))
            low, high = self._recent.min(axis=0), self._recent.max(axis=0)
            deviation = np.maximum(np.maximum(low - packet.q, packet.q - high), 0.0)
            self._check(deviation)
        if self.causes:
            notes.append("stopped: " + "; ".join(self.causes))
        self._cycle = Cycle(packet, qd, self.phase, seeded, missed, deviation, tuple(notes), waited)
        return self._cycle

    def answer(self, reference: JointReference | None) -> bytes | None:
        """The answer to the cycle taken last; None if it was answered before.

        Args:
            reference: Of the source for this tick, starting at the measured pose when the cycle was `seeded`. None, or
                one that cannot be used, makes the robot brake for this tick. Only looked at if the cycle is `moving`.
        """
        cycle, self._cycle = self._cycle, None
        if cycle is None:
            return None
        if self.phase in (Phase.RAMPING, Phase.RUNNING):
            self._follow(reference)
        if self.phase == Phase.STOPPING:  # maybe since a moment ago
            if self._shaper.brake():
                self.phase = Phase.STOPPED
                self._rest = cycle.packet.q if self._relax else None
        elif self.phase == Phase.STOPPED and self._rest is not None:
            self._shaper.settle(self._rest)
        self._remember(self.q)
        self._ticks += 1
        data = encode_sensor(SensorPacket(self._seq, int(self._now * 1e3), self.q, self.qd), self.axes)
        self._seq += 1
        self.counts["answered"] += 1
        return data

    def _follow(self, reference: JointReference | None) -> None:
        usable = _usable(reference, self.n)
        if usable is None:
            self.counts["bad_reference"] += 1
            self._shaper.brake()
            return
        jump = self._jump(usable)
        if jump:
            self.stop(jump)
            return
        self._source, self._ticks = usable, 0
        self._shaper.follow(usable.q, usable.qd)
        self.counts["clipped"] += self._shaper.clipped
        if self._shaper.weight >= 1.0:
            self.phase = Phase.RUNNING

    def _seed(self, q: Array) -> None:
        self._shaper.seed(q)
        self._recent[:] = q
        self._source, self._ticks = None, 1
        self._relax, self._rest = False, None

    def _remember(self, q: Array) -> None:
        self._recent[:-1] = self._recent[1:]
        self._recent[-1] = q

    def _check(self, deviation: Array) -> None:
        if self._relax or self.phase == Phase.STOPPED or (deviation <= self.rules.deviation).all():
            return  # whatever else falls behind while a robot that is held brakes has the same cause
        worst = int(np.argmax(deviation))
        self._relax = True  # once at rest, do not go on pushing against what holds the robot back
        self.stop(f"{self.names[worst]} is {deviation[worst]:.3g} rad from what it was sent")

    def _jump(self, reference: JointReference) -> str:
        """What the source did that no source within the limits does, in words."""
        last, start = self._source, self._shaper.q
        moved = np.abs(reference.q - (start if last is None else last.q))
        excess = moved - self.limits.max_velocity * self.limits.dt * self._ticks
        worst = int(np.argmax(excess))
        if excess[worst] <= self.rules.jump:
            return ""
        place = "the measured pose" if last is None else "its last one"
        return f"the reference of {self.names[worst]} is {moved[worst]:.3g} rad from {place}"

    def _velocity(self, packet: RobotPacket) -> Array:
        """By differences over the robot's own clock, or over the number of its packets where that clock jumps."""
        before = self._before
        if before is None or before.clock is None or packet.clock is None:
            return np.zeros(self.n)
        counted = (packet.seq - before.seq) % WRAP * self.limits.dt
        elapsed = packet.clock - before.clock
        return (packet.q - before.q) / (elapsed if 0.5 * counted <= elapsed <= 2.0 * counted else counted)

    def _closed(self, packet: RobotPacket) -> list[str]:
        """What keeps the robot from being driven, in words."""
        states = {"motion control": packet.mci, "the RAPID program": packet.rapid}
        found = [] if packet.motors_on else ["motors are off"]
        return found + [f"{name} is {state}" for name, state in states.items() if state != "running"]


def _usable(reference: JointReference | None, n: int) -> JointReference | None:
    """The reference as finite numbers, one a joint; None if it is inactive or something else."""
    try:
        if reference is None or not reference.active:
            return None
        q, qd = np.array(reference.q, dtype=np.float64), np.array(reference.qd, dtype=np.float64)
        if not (q.shape == qd.shape == (n,) and np.isfinite(q).all() and np.isfinite(qd).all()):
            return None
        return JointReference(int(reference.seq), 0.0, q, qd)
    except Exception:  # whatever it was, no robot is driven by it
        return None
