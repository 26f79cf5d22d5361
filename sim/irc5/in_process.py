"""The other end of the wire in the same process: session, loop and controller of `qpsafe stream`, without sockets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from qpsafe.controller import SafetyController
from qpsafe.irc5.loop import LoopRules, StreamLoop
from qpsafe.irc5.messages import RobotPacket, SensorPacket, decode_sensor, encode_robot
from qpsafe.irc5.process.warm_up import session_limits
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.session import Cycle, EgmSession
from qpsafe.irc5.supervisor import Supervisor
from qpsafe.irc5.transport.axes import axes_of_robot

Array = NDArray[np.float64]

ROBOT_ADDRESS = ("127.0.0.1", 6599)  # of the pretended sender


class Here:
    """Answers at once, in simulated time.

    Args:
        controller: Makes the references.
        rules, session_rules: As for `qpsafe stream`.

    Attributes:
        loop: What `qpsafe stream` runs.
        cycle: The last one answered, None if there was nothing to answer in the last turn.
        now: Simulated time [s].
    """

    def __init__(
        self,
        controller: SafetyController,
        rules: LoopRules | None = None,
        session_rules: SessionRules | None = None,
    ) -> None:
        self.now = 0.0
        self.dt = controller.dt
        robot = controller.robot
        session = EgmSession(
            session_limits(controller), session_rules, joint_names=robot.joint_names, axes=axes_of_robot(robot)
        )
        self.loop = StreamLoop(controller, session, Supervisor(self.clock), rules)
        self.cycle: Cycle | None = None
        self._heard = 0.0

    def clock(self) -> float:
        """Simulated time [s]."""
        return self.now

    def swap(self, packet: RobotPacket | None, distances: Array) -> tuple[Sequence[SensorPacket], Sequence[str]]:
        """See `Exchange`."""
        datagrams = [] if packet is None else [(encode_robot(packet, self.loop.session.axes), ROBOT_ADDRESS)]
        answers = self.receive(datagrams, distances)
        axes = self.loop.session.axes
        return [decode_sensor(data, axes) for data in answers], self.loop.take_events()

    def receive(
        self, datagrams: Sequence[tuple[bytes, tuple[str, int]]], distances: Array | None, age: float = 0.0
    ) -> list[bytes]:
        """One turn of the loop.

        Args:
            datagrams: What has arrived, and from whom.
            distances: Readings of the spots (k,) [m].
            age: How old they are [s].

        Returns:
            The answer, if there is one to give.
        """
        session, loop = self.loop.session, self.loop
        self.now += self.dt
        for data, sender in datagrams:
            session.offer(data, sender, self.now)
        cycle = self.cycle = session.take()
        if cycle is None:
            loop.silent(self.now - self._heard)
            return []
        self._heard = self.now
        ages = None if distances is None else np.full(len(distances), age)
        reference = loop.step(cycle, distances, ages)
        if loop.over:
            return []
        answer = session.answer(reference)
        return [] if answer is None else [answer]
