"""A session without a socket, a robot that does as it is told, and a source of references."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from qpsafe.irc5 import messages
from qpsafe.irc5.messages import RobotPacket, SensorPacket
from qpsafe.irc5.session import Cycle, EgmSession, Phase
from qpsafe.limits import JointLimits
from qpsafe.reference import JointReference

DT, N = 0.004, 3
V_MAX, A_MAX = np.array([3.0, 2.0, 5.0]), np.array([10.0, 8.0, 20.0])
LIMITS = JointLimits(np.full(N, -2.0), np.full(N, 2.0), V_MAX, A_MAX, DT)
START = np.array([0.3, -0.4, 0.5])
PEER = ("127.0.0.1", 5000)


class Source:
    """References that start at rest at a pose and then go back and forth, within the limits."""

    def __init__(self, q: np.ndarray) -> None:
        self.q, self.seq = q.copy(), 0

    def step(self) -> JointReference:
        """The next one."""
        qd = np.array([0.5, -0.4, 0.8]) * np.sin(2.0 * DT * self.seq)
        self.q = self.q + qd * DT
        self.seq += 1
        return JointReference(self.seq, self.seq * DT, self.q, qd)


@dataclass
class Wire:
    """A session, a robot that does as it is told, and everything that was said."""

    session: EgmSession = field(default_factory=lambda: EgmSession(LIMITS))
    q: np.ndarray = field(default_factory=START.copy)
    seq: int = 0
    time: float = 100.0
    clock: float = 5000.0
    states: dict[str, Any] = field(default_factory=dict)
    source: Source | None = None
    answers: list[SensorPacket] = field(default_factory=list)
    cycles: list[Cycle] = field(default_factory=list)

    def packet(self, **changes: Any) -> bytes:
        """The robot's next words, with changes."""
        values = {"seq": self.seq, "time_ms": 4 * self.seq, "q": self.q, "clock": self.clock, **self.states, **changes}
        return messages.encode_robot(RobotPacket(**values))

    def pass_time(self, ticks: int = 1) -> None:
        """Of the robot's clock and of ours."""
        self.seq = (self.seq + ticks) % 2**32
        self.time += ticks * DT
        self.clock += ticks * DT

    def offer(self, data: bytes, sender: tuple[str, int] = PEER) -> bool:
        """Whether the session takes a packet."""
        return self.session.offer(data, sender, self.time)

    def answer(self, reference: Any = "source") -> SensorPacket | None:
        """Take the cycle and answer it; the source starts anew when asked to."""
        cycle = self.session.take()
        if cycle is None:
            return None
        self.cycles.append(cycle)
        if cycle.seeded or self.source is None:
            self.source = Source(cycle.packet.q)
        if isinstance(reference, str):
            reference = self.source.step() if cycle.moving else None
        data = self.session.answer(reference)
        assert data is not None
        self.answers.append(messages.decode_sensor(data, N))
        return self.answers[-1]

    def exchange(self, ticks: int = 1, reference: Any = "source", **changes: Any) -> SensorPacket:
        """Whole cycles; the robot is where it was sent one tick ago."""
        for _ in range(ticks):
            self.pass_time()
            assert self.offer(self.packet(**changes))
            found = self.answer(reference)
            assert found is not None
            self.q = found.q_ref.copy()
        return found

    def run(self) -> Wire:
        """Until the source drives the robot."""
        self.exchange(200)
        assert self.session.phase == Phase.RUNNING
        return self

    def check_steps(self, since: int = 0) -> None:
        """From answer to answer: position and speed go together, and neither jumps."""
        for last, now in zip(self.answers[since:], self.answers[since + 1 :], strict=False):
            assert np.allclose(now.q_ref, last.q_ref + now.qd_ref * DT, rtol=0, atol=1e-9)
            assert (np.abs(now.qd_ref) <= V_MAX * (1 + 1e-9)).all()
            assert (np.abs(now.qd_ref - last.qd_ref) <= A_MAX * DT * (1 + 1e-9)).all()
