"""The simulated robot's sockets: packets out, answers in, distances out, events in; and a wire that can be bad."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError, QpsafeError
from qpsafe.irc5.distances import SensorOutput
from qpsafe.irc5.messages import (
    MAX_SIZE,
    MalformedPacket,
    RobotPacket,
    SensorPacket,
    decode_sensor,
    encode_robot,
)
from qpsafe.irc5.transport.addresses import host_address, udp_port
from qpsafe.irc5.transport.axes import Axes, axes_of
from qpsafe.sim.irc5.link import NO_FAULTS, Wire, WireFaults

Array = NDArray[np.float64]
_AGAIN = 0.5  # [s]; how soon what nobody has answered yet is sent again


class NoAnswerError(QpsafeError, RuntimeError):
    """In lock-step, the other end did not answer in time."""


class UdpExchange:
    """One robot's end of the wire; see `qpsafe.sim.irc5.irc5_loop.Exchange`.

    Args:
        joints: How many the robot has, or which of them are external.
        stream: Address of `qpsafe stream`; None: `aim` tells it later.
        sensors: Where distances go, None for nowhere.
        faults: Of the wire, both ways.
        strangers: Share of cycles in which somebody else sends a packet with other joint values.
        seed: Draws when.
        lockstep: Wait this long for the answer to every packet [s]; 0: do not wait.
        event_port: Where names of events are taken, on loopback; 0 for any port.
        patience: In lock-step, how long to wait for the very first answer [s]; what is sent is repeated meanwhile,
            since the other end may not be there yet.
        over: Asked while waiting in lock-step: whether to wait no longer.

    Attributes:
        events: Address at which names of events are taken.
        rejected: Datagrams that are no answer.
    """

    def __init__(
        self,
        joints: int | Axes,
        stream: tuple[str, int] | None,
        sensors: tuple[str, int] | None = None,
        *,
        faults: WireFaults = NO_FAULTS,
        strangers: float = 0.0,
        seed: int = 0,
        lockstep: float = 0.0,
        event_port: int = 0,
        patience: float = 60.0,
        over: Callable[[], bool] = lambda: False,
    ) -> None:
        if not 0.0 <= strangers <= 1.0:
            raise ConfigurationError("UdpExchange", "strangers", strangers, "0 to 1")
        self._axes, self.strangers = axes_of(joints) if isinstance(joints, int) else joints, strangers
        self._sensors: SensorOutput | None = None
        self._stream = ("127.0.0.1", 9)  # discard
        if stream is not None:
            self.aim(stream, sensors)
        self._socket, self._stranger, self._events = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in "123")
        try:
            self._events.bind(("127.0.0.1", event_port))
        except OSError as error:
            raise ConfigurationError("UdpExchange", "event_port", event_port, f"a free port ({error})") from None
        for each in (self._socket, self._stranger, self._events):
            each.setblocking(False)
        self.events: tuple[str, int] = self._events.getsockname()
        self._rng = np.random.default_rng((seed, 7))
        self.out, self.back = (Wire(faults, np.random.default_rng((seed, k))) for k in range(2))
        self._lockstep, self._patience, self._over = lockstep, patience, over
        self.rejected = 0

    def aim(self, stream: tuple[str, int], sensors: tuple[str, int] | None) -> None:
        """Tell where the other end listens.

        Raises:
            ConfigurationError: A host has no address, or a port is none.
        """
        host, port = stream  # looked up here once: with a name every cycle would ask for its address
        self._stream = host_address("UdpExchange", "host", host), udp_port("UdpExchange", port, least=1)
        self._sensors = None if sensors is None else SensorOutput(*sensors)

    def close(self) -> None:
        """Close all sockets."""
        for each in (self._socket, self._stranger, self._events):
            each.close()
        if self._sensors is not None:
            self._sensors.close()

    def set_faults(self, faults: WireFaults) -> None:
        """Let the wire be bad, or good again, from now on."""
        self.out.faults = self.back.faults = faults

    def swap(self, packet: RobotPacket | None, distances: Array) -> tuple[Sequence[SensorPacket], Sequence[str]]:
        """See `Exchange`; first what has come, then what goes; in lock-step the other way round.

        Raises:
            NoAnswerError: In lock-step, there was none in time.
        """
        came = [] if self._lockstep else self._arrived()
        self._sense(distances)
        if packet is not None:
            self.out.put(encode_robot(packet, self._axes))
            if self._rng.random() < self.strangers:
                other = RobotPacket(packet.seq + 1, packet.time_ms, packet.q + 0.5, clock=packet.clock)
                self._send(self._stranger, encode_robot(other, self._axes))
        sent = self.out.take()
        for data in sent:
            self._send(self._socket, data)
        if self._lockstep and packet is not None:
            return self._wait(sent, distances), self._names()
        return self._decoded(came), self._names()

    def _decoded(self, came: list[bytes]) -> list[SensorPacket]:
        """The answers among what has come; the rest is counted."""
        answers = []
        for data in came:
            try:
                answers.append(decode_sensor(data, self._axes))
            except MalformedPacket:
                self.rejected += 1
        return answers

    def _send(self, sender: socket.socket, data: bytes) -> None:
        with suppress(OSError):  # nobody there yet
            sender.sendto(data, self._stream)

    def _arrived(self) -> list[bytes]:
        for data in _drain(self._socket):
            self.back.put(data)
        return self.back.take()

    def _sense(self, distances: Array) -> None:
        if self._sensors is not None:
            self._sensors.send(distances)

    def _wait(self, sent: list[bytes], distances: Array) -> list[SensorPacket]:
        """The answer to the packets just sent, through a good wire; none where it is over."""
        start = again = time.monotonic()
        while (now := time.monotonic()) < start + max(self._lockstep, self._patience):
            select.select([self._socket], [], [], 0.1)
            answers = self._decoded(_drain(self._socket))
            if answers or self._over():
                self._patience = 0.0 if answers else self._patience
                return answers
            if self._patience and now >= again + _AGAIN:  # a datagram to a port that nobody has opened yet is lost
                again = now
                self._sense(distances)
                for data in sent:
                    self._send(self._socket, data)
        raise NoAnswerError("no answer in lock-step: is qpsafe stream running, and not leaving?")

    def _names(self) -> list[str]:
        return [data.decode("ascii", "replace") for data in _drain(self._events)]


def _drain(entrance: socket.socket) -> list[bytes]:
    """All that has arrived."""
    found: list[bytes] = []
    while len(found) < 1000:
        try:
            found.append(entrance.recv(MAX_SIZE))
        except BlockingIOError:
            break
        except OSError:  # an ICMP error: nobody listened to an earlier packet
            continue
    return found
