"""The PC's end of EGM: a UDP server that waits for the robot, and answers each of its packets once."""

from __future__ import annotations

import select
import socket
import time
from collections import Counter
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Self

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.messages import DEFAULT_PORT, MAX_SIZE
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.session import Cycle, EgmSession, Phase
from qpsafe.irc5.transport.addresses import interface_address, peer_address, udp_port
from qpsafe.irc5.transport.arrival import Waits, receive
from qpsafe.irc5.transport.axes import Axes
from qpsafe.limits import JointLimits
from qpsafe.reference import JointReference

#: Datagrams read at once before a packet is answered, so that a flood of junk cannot keep the robot waiting for ever.
MOST_AT_ONCE = 256


class EgmStreamer:
    """Streams references to one robot.

    ```
    with EgmStreamer(limits, host="192.168.125.99") as streamer:
        while (cycle := streamer.wait(1.0)) is not None:
            if cycle.seeded:
                controller.reset()
            streamer.answer(controller.step(cycle.packet.q, cycle.qd, distances).reference)
    ```

    Leaving the `with` block, for whatever reason, first brings the robot to rest.

    Args:
        limits: Joint limits with the tick, e.g. `JointLimits` of the robot; no answer goes beyond them.
        host: Address of this computer, or name of its network interface, that the robot speaks to. Only there datagrams
            are taken; the default is for simulated robots on this computer.
        port: The robot's configuration has it; 0 for any free one.
        rules: How to ramp, and what counts as wrong.
        peer: Address of the robot, or its name; by default the address of the first valid packet.
        joint_names: For the reports.
        axes: Which joints are external; by default those from the seventh on.

    Attributes:
        session: What decides; its phase, causes and counts.
        address: Address and port it listens at.
        stamped: Whether the kernel says when packets arrived; else it is when they were read.
        response: Of the last answer, from the arrival of the oldest packet since the one before to its leaving [s].
            The newest is answered, but a delay in which several came must show in full.

    Raises:
        ConfigurationError: The host is unknown here, or stands for all interfaces; the port is no port, or is taken;
            the peer has no address.
    """

    def __init__(
        self,
        limits: JointLimits,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        rules: SessionRules | None = None,
        peer: str | None = None,
        joint_names: Sequence[str] | None = None,
        axes: Axes | None = None,
    ) -> None:
        known = None if peer is None else peer_address(peer)
        self.session = EgmSession(limits, rules, known, joint_names, axes)
        where = interface_address(host), udp_port("EgmStreamer", port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(where)
        except OSError as error:
            self._socket.close()
            found = f"{host}:{port}"
            raise ConfigurationError("EgmStreamer", "host", found, f"an address to listen at ({error})") from None
        self._socket.setblocking(False)
        self.address: tuple[str, int] = self._socket.getsockname()
        self._waits = Waits(self._socket)
        self.stamped = self._waits.stamped
        self.response = 0.0
        self._arrived = 0  # real-time clock, of the oldest packet since the last answer [ns]; 0 without one

    @property
    def counts(self) -> Counter[str]:
        """What became of datagrams, answers and references, see `EgmSession`."""
        return self.session.counts

    @property
    def phase(self) -> Phase:
        """What the robot is being answered."""
        return self.session.phase

    def wait(self, timeout: float) -> Cycle | None:
        """Block until the robot speaks, and take its newest packet.

        Args:
            timeout: Longest time to wait [s]; what is no newer packet of the robot does not prolong it.

        Returns:
            The cycle to answer, or None after the timeout.
        """
        end = time.monotonic() + timeout
        while True:
            self._drain()
            cycle = self.session.take()
            left = end - time.monotonic()
            if cycle is not None or left <= 0.0:
                return cycle
            select.select([self._socket], [], [], left)

    def answer(self, reference: JointReference | None) -> bool:
        """Answer the cycle taken last, at most once; see `EgmSession.answer`. Returns whether it was sent."""
        data = self.session.answer(reference)
        if data is None or self.session.sender is None:
            return False
        try:
            self._socket.sendto(data, self.session.sender)
        except OSError:
            self.counts["not_sent"] += 1
            return False
        finally:
            arrived, self._arrived = self._arrived, 0
            self.response = 1e-9 * (time.time_ns() - arrived)
        return True

    def stop(self, cause: str) -> None:
        """Bring the robot to rest over the next answers, and hold it until `acknowledge`."""
        self.session.stop(cause)

    def acknowledge(self) -> bool:
        """A person has seen to the cause of the stop. Returns False before the robot is stopped."""
        return self.session.acknowledge()

    def finish(self, patience: float = 0.2, meanwhile: Callable[[], None] = lambda: None) -> bool:
        """Answer until the robot is at rest: to fall silent before would leave it at its last speed.

        Args:
            patience: How long to wait for each of its packets [s].
            meanwhile: Called before each answer, e.g. to tell a watchdog.

        Returns:
            Whether it was brought to rest; False if it did not speak any more.
        """
        self.stop("the stream ends")
        while not self.session.at_rest:
            if self.wait(patience) is None:
                return False
            meanwhile()
            self.answer(None)
        return True

    def close(self) -> None:
        """Fall silent at once; `finish` before."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.finish()
        finally:
            self.close()

    def _drain(self) -> None:
        """Offer everything that has arrived, with how long it has waited, where the kernel tells that."""
        self._waits.look()
        for _ in range(MOST_AT_ONCE):
            try:
                data, sender, arrived = receive(self._socket, MAX_SIZE + 1)  # what fills it is too long
            except BlockingIOError:
                self._waits.emptied()
                return
            except OSError:  # an earlier answer found nobody
                self.counts["not_received"] += 1
                continue
            self._waits.look()  # again: what came after the first look is not as old as it can be
            waited = self._waits.of(arrived) if self.stamped else 0.0
            if self.session.offer(data, sender, time.monotonic(), waited) and self._arrived == 0:
                self._arrived = arrived
