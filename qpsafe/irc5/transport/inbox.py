"""What a robot sends is accepted, or refused with a reason and counted; junk changes nothing else."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.irc5.messages import REASONS, WRAP, MalformedPacket, RobotPacket, decode_robot
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.transport.axes import Axes, axes_of

#: Address and port.
Sender = tuple[str, int]

#: Why a datagram was refused, beyond the reasons of `MalformedPacket`.
WRONG_SENDER, STALE, DUPLICATE = "wrong_sender", "stale", "duplicate"
NO_CLOCK, IMPLAUSIBLE = "no_clock", "implausible"
REFUSALS = (*REASONS, WRONG_SENDER, STALE, DUPLICATE, NO_CLOCK, IMPLAUSIBLE)

#: What an accepted packet is.
FRESH, RESTART = "fresh", "restart"

#: No joint turns this far, even without limits [rad].
_ABSURD = 1e4

#: Packets in a row that prove a restart of a robot whose clock went back.
_PROOF = 3


class Arrival(NamedTuple):
    """An accepted packet.

    Attributes:
        packet: What the robot says.
        restarted: Whether it starts anew with this packet: the first one, the first after a restart or after a silence.
        missed: Packets missing since the one accepted before.
    """

    packet: RobotPacket
    restarted: bool
    missed: int


class Inbox:
    """The sieve for datagrams. Never raises.

    Refused are: other senders than the robot, what is no EgmRobot of n finite joints, packets without a clock (before
    RobotWare 6.07, units were mixed), joints far outside their limits, and packets that are not newer than the newest
    one, where numbers wrap around modulo 2^32. An older number with a later clock comes from a robot that restarted.

    Args:
        lower, upper: Joint limits (n,) [rad], may be infinite.
        rules: `silence`, `most_missed` and `margin` of them.
        peer: Address of the robot; by default that of the first valid packet, from then on.
        axes: Which joints are external; by default those from the seventh on.

    Attributes:
        counts: Datagrams by what became of them: ``accepted``, or one of `REFUSALS`; ``missed``, ``restarts``.
        sender: The robot's address and port, None before its first valid packet.
        refusal: The last refusal in words, empty before.
    """

    def __init__(
        self,
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        rules: SessionRules | None = None,
        peer: str | None = None,
        axes: Axes | None = None,
    ) -> None:
        self._axes = axes_of(len(lower)) if axes is None else axes
        self.rules = SessionRules() if rules is None else rules
        self._lowest = np.maximum(lower - self.rules.margin, -_ABSURD)
        self._highest = np.minimum(upper + self.rules.margin, _ABSURD)
        self._peer = peer
        self.counts: Counter[str] = Counter()
        self.refusal = ""
        self.sender: Sender | None = None
        self._last: RobotPacket | None = None
        self._last_time = -np.inf
        self._proof: list[int] = []

    def offer(self, data: bytes, sender: Sender, now: float) -> Arrival | None:
        """Accept a datagram, or refuse and count it.

        Args:
            data: The datagram.
            sender: Where it came from.
            now: A monotonic clock of this computer [s].

        Returns:
            The packet if it is the newest from the robot, else None.
        """
        silent = now - self._last_time > self.rules.silence
        try:
            if not self._known(sender, silent):
                raise MalformedPacket(WRONG_SENDER, f"{sender[0]}:{sender[1]} is not the robot")
            packet = decode_robot(data, self._axes)
            kind, missed = self._check(packet, silent)
        except MalformedPacket as problem:
            self.counts[problem.reason] += 1
            self.refusal = str(problem)
            return None
        restarted = kind == RESTART or sender != self.sender or silent
        self.counts["restarts"] += restarted and self._last is not None
        self.counts["accepted"] += 1
        self.counts["missed"] += missed
        self.sender, self._last, self._last_time, self._proof = sender, packet, now, []
        return Arrival(packet, restarted, missed)

    def _check(self, packet: RobotPacket, silent: bool) -> tuple[str, int]:
        """See `_order`; raises MalformedPacket on what is to be refused."""
        if packet.clock is None:
            raise MalformedPacket(NO_CLOCK, "no feedBack.time: RobotWare before 6.07 mixes units, update it")
        if not ((self._lowest <= packet.q) & (packet.q <= self._highest)).all():
            raise MalformedPacket(IMPLAUSIBLE, f"joints measured far outside their limits: {packet.q} rad")
        kind, missed = self._order(packet, packet.clock, silent)
        if kind in (STALE, DUPLICATE):
            raise MalformedPacket(kind, f"packet {packet.seq} is not newer than the newest one")
        return kind, missed

    def _known(self, sender: Sender, silent: bool) -> bool:
        """The pinned sender; after a silence another port of its address, where a restarted robot may come back."""
        if self.sender is None:
            return self._peer is None or sender[0] == self._peer
        return sender == self.sender or (silent and sender[0] == self.sender[0])

    def _order(self, packet: RobotPacket, clock: float, silent: bool) -> tuple[str, int]:
        """Whether a packet is fresh, stale, a duplicate or first after a restart; how many are missing before it."""
        last = self._last
        if last is None or last.clock is None:
            return RESTART, 0
        ahead = (packet.seq - last.seq) % WRAP
        if 0 < ahead <= self.rules.most_missed:
            return FRESH, ahead - 1
        if clock > last.clock:  # sent later under an older number: what was only delayed bears an older clock, too
            return RESTART, 0
        if silent:  # the controller's clock may have gone back: several in a row cannot all be delayed ones
            self._proof = [*self._proof, packet.seq] if self._proof and packet.seq > self._proof[-1] else [packet.seq]
            if len(self._proof) >= _PROOF:
                return RESTART, 0
        return (DUPLICATE if ahead == 0 else STALE), 0
