"""Distances over UDP: one datagram per sampling of all spots, from whatever reads the sensors to the loop.

Little-endian, 24 + 8 k bytes, or 24 + 16 k with ages (docs/how-to/stream.md has the same table):

    offset  type         what
    0       4 bytes      "QPSD"
    4       uint8        version, 1
    5       uint8        flags; 1: ages follow the distances
    6       uint16       k, number of spots
    8       uint32       sequence number, wraps around
    12      uint32       0
    16      uint64       sender's time [µs], for logs
    24      k float64    distances in the order of spots.toml [m]; +inf: nothing in sight, NaN: no reading (REP 117)
    ...     k float64    how old each reading was when it was sent [s], with flag 1
"""

from __future__ import annotations

import socket
import struct
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.transport.addresses import host_address, peer_address, udp_port
from qpsafe.irc5.transport.arrival import Waits, receive
from qpsafe.sensing.rules import SensingRules
from qpsafe.text.given import MOST, number, numbers, whole
from qpsafe.text.words import counted

Array = NDArray[np.float64]

DEFAULT_PORT = 6511
#: A sender's clock may run ahead by this [s]; ages further below zero are passed on as they are, and are sick.
CLOCK_ERROR = SensingRules.clock_error
#: What came less than this before it was first read counts as new [s]: half the age at which distances are stale, so
#: that a run in lock-step, where a busy computer takes its time, is the same to the bit as one without a wire.
NEW = 0.5 * SensingRules.max_age
#: Most spots of a datagram without ages, and with them: 65,507 bytes fit into one.
MOST_SPOTS, MOST_AGED = 8185, 4092
_HEAD = struct.Struct("<4sBBHIIQ")
_MAGIC, _VERSION, _AGES = b"QPSD", 1, 1


class Distances(NamedTuple):
    """One sampling.

    Attributes:
        seq: Sequence number, modulo 2^32.
        time: Sender's time [s].
        values: (k,) [m].
        ages: (k,) [s] when sent, or None.
    """

    seq: int
    time: float
    values: Array
    ages: Array | None = None


def encode(distances: Distances) -> bytes:
    """As a datagram, one that `decode` reads.

    Raises:
        ConfigurationError: Values or ages are no list of numbers, not as many of both, or more than fit; sequence
            number or time is none.
    """
    ages = distances.ages
    most = MOST_SPOTS if ages is None else MOST_AGED
    expected = f"distances (k,) [m], k at most {most} {'without' if ages is None else 'with'} ages"
    rows = [numbers("distances", "values", distances.values, expected, 1)]
    k = len(rows[0])
    if k > most:
        raise ConfigurationError("distances", "values", rows[0].shape, expected)
    if ages is not None:
        rows.append(numbers("distances", "ages", ages, f"ages ({k},) [s], one a distance", 1))
        if len(rows[1]) != k:
            raise ConfigurationError("distances", "ages", rows[1].shape, f"ages ({k},) [s], one a distance")
    seq = whole("distances", "seq", distances.seq, "a whole number", -MOST)
    micros = round(1e6 * number("distances", "time", distances.time, "a time [s]", -1e15, most=1e15))
    flags = 0 if ages is None else _AGES
    head = _HEAD.pack(_MAGIC, _VERSION, flags, k, seq % 2**32, 0, micros % 2**64)
    return head + b"".join(row.astype("<f8").tobytes() for row in rows)


def decode(data: bytes, count: int) -> Distances | None:
    """Read a datagram for `count` spots; None if it is none. Values are not judged here: the sensing does that."""
    if len(data) < _HEAD.size:
        return None
    magic, version, flags, k, seq, zero, micros = _HEAD.unpack_from(data)
    if magic != _MAGIC or version != _VERSION or flags & ~_AGES or zero != 0 or k != count:
        return None
    rows = 2 if flags & _AGES else 1
    if len(data) != _HEAD.size + 8 * rows * k:
        return None
    numbers = np.frombuffer(data, dtype="<f8", offset=_HEAD.size).astype(np.float64).reshape(rows, k)
    return Distances(seq, 1e-6 * micros, numbers[0], numbers[1] if rows == 2 else None)


@dataclass
class SensorCounts:
    """What came in.

    Attributes:
        used: Samplings that were read.
        skipped: Samplings that a newer one had overtaken when the loop looked.
        stale: Duplicates, and samplings that arrived after a newer one.
        rejected: Datagrams that are no sampling for these spots.
        strangers: Datagrams from another sender than the first.
    """

    used: int = 0
    skipped: int = 0
    stale: int = 0
    rejected: int = 0
    strangers: int = 0


class SensorInput:
    """Where the loop gets its distances from: never waits, never raises on what arrives.

    Ages are counted from the arrival at this computer: what waited in the socket is as old as it is.

    Args:
        count: Number of spots.
        host: Address of the interface to listen at, or a name of it; loopback by default.
        port: 0 lets the system choose one.
        peer: Host that may send, by its address or name; by default the first that sends a sampling.

    Raises:
        ConfigurationError: The count is none, a host has no address, or the address to listen at cannot be had.
    """

    RESTART_AFTER = 1.0  # after this silence, another port or a lower sequence number is a restarted sender [s]

    def __init__(self, count: int, host: str = "127.0.0.1", port: int = DEFAULT_PORT, peer: str | None = None) -> None:
        expected = f"a number of spots, 0 to {MOST_SPOTS}"
        self.count, self.counts = whole("SensorInput", "count", count, expected, 0, MOST_SPOTS), SensorCounts()
        self.refusal = ""  # the last one in words
        self._host, self._port = None if peer is None else peer_address(peer, "SensorInput"), 0
        where = host_address("SensorInput", "host", host), udp_port("SensorInput", port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._waits = Waits(self._socket)
        try:
            self._socket.bind(where)
        except OSError as error:
            self._socket.close()
            raise ConfigurationError("SensorInput", "address", f"{host}:{port}", f"a free address ({error})") from None
        self._socket.setblocking(False)
        self._newest: Distances | None = None
        self._told = False  # whether it has been read
        self._arrived = -np.inf  # on the clock of whoever reads [s]

    @property
    def address(self) -> tuple[str, int]:
        """Where it listens."""
        host, port = self._socket.getsockname()
        return host, port

    def close(self) -> None:
        """Give the address back."""
        self._socket.close()

    def read(self, now: float | None = None) -> tuple[Array, Array]:
        """The newest sampling: distances (k,) [m] and how old each is (k,) [s]; before the first, NaN and infinite."""
        now = time.monotonic() if now is None else now
        self.listen(now)
        newest = self._newest
        if newest is None:
            return np.full(self.count, np.nan), np.full(self.count, np.inf)
        if not self._told:
            self._told = True
            self.counts.used += 1
            if now - self._arrived < NEW:
                self._arrived = now
        silence = max(now - self._arrived, 0.0)
        if newest.ages is None:
            return newest.values, np.full(self.count, silence)
        # silence adds to what was sent, but never makes an age possible that was not
        sent = newest.ages
        return newest.values, np.where(sent < -CLOCK_ERROR, sent, silence + np.maximum(sent, 0.0))

    def listen(self, now: float | None = None) -> None:
        """Take in what has come, so that the system need not drop what comes next; for when nobody reads.

        Args:
            now: As for `read`, of the same clock [s].
        """
        now = time.monotonic() if now is None else now
        self._waits.look()
        for _ in range(1000):  # a flood must not hold the loop
            try:
                data, sender, arrived = receive(self._socket, 65536)
            except BlockingIOError:
                self._waits.emptied()
                break
            except OSError:  # e.g. an ICMP error that a datagram of ours has caused
                continue
            self._take(data, sender, now - self._waits.of(arrived))

    def _take(self, data: bytes, sender: tuple[str, int], arrived: float) -> None:
        restarted = arrived - self._arrived > self.RESTART_AFTER
        if self._host not in (None, sender[0]) or not (restarted or self._port == sender[1]):
            self.counts.strangers += 1
            self.refusal = f"{sender[0]}:{sender[1]} is not the sender of the distances"
            return
        found = decode(data, self.count)
        if found is None:
            self.counts.rejected += 1
            self.refusal = f"{counted(len(data), 'byte')}, no sampling of {counted(self.count, 'spot')}"
            return
        if self._newest is not None and not restarted and not 0 < (found.seq - self._newest.seq) % 2**32 < 2**31:
            self.counts.stale += 1
            return
        self._host, self._port = sender  # the first one is the one
        self.counts.skipped += self._newest is not None and not self._told
        self._newest, self._arrived, self._told = found, arrived, False


class SensorOutput:
    """The sender's side: for simulations, and to try the loop out.

    Args:
        host: Where the loop listens.
        port: Its port.

    Raises:
        ConfigurationError: The host has no address, or the port is none.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = DEFAULT_PORT) -> None:
        self._address = host_address("SensorOutput", "host", host), udp_port("SensorOutput", port, least=1)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._seq = 0

    def send(self, values: Array, ages: Array | None = None) -> None:
        """Send one sampling; nobody listening is no error.

        Args:
            values: Distances (k,) [m].
            ages: How old each of them is (k,) [s]; None: they are new.

        Raises:
            ConfigurationError: They are no such numbers, or more than fit into a datagram, as for `encode`.
        """
        with suppress(OSError):
            self._socket.sendto(encode(Distances(self._seq, time.time(), values, ages)), self._address)
        self._seq = (self._seq + 1) % 2**32

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
