"""Datagrams and when they arrived at this computer: where the kernel says so, waiting in it included."""

from __future__ import annotations

import socket
import struct
import sys
import time
from typing import Any

_STAMP = getattr(socket, "SO_TIMESTAMPNS", 35)  # Linux: when the kernel received a datagram, on the real-time clock
_TIMESPEC = struct.Struct("@ll")


def ask_for_times(entrance: socket.socket) -> bool:
    """Ask the kernel to note when datagrams arrive; whether it does."""
    if sys.platform != "linux":
        return False
    entrance.setsockopt(socket.SOL_SOCKET, _STAMP, 1)
    return True


def receive(entrance: socket.socket, size: int) -> tuple[bytes, Any, int]:
    """The next datagram, its sender, and when it arrived, on the real-time clock [ns]: by default, now.

    Raises:
        BlockingIOError: There is none.
        OSError: An earlier datagram found nobody.
    """
    if sys.platform == "win32":  # has no recvmsg
        data, sender = entrance.recvfrom(size)
        return data, sender, time.time_ns()
    data, notes, _, sender = entrance.recvmsg(size, 64)
    for level, kind, note in notes:
        if level == socket.SOL_SOCKET and kind == _STAMP and len(note) >= _TIMESPEC.size:
            seconds, nanos = _TIMESPEC.unpack_from(note)
            return data, sender, seconds * 1_000_000_000 + nanos
    return data, sender, time.time_ns()


class Waits:
    """How long datagrams have waited in a socket: never less than they have, whatever is done to the clocks.

    The kernel's times are of the real-time clock, which may be set at any moment; by the monotonic clock it is known
    only that what is read now has come since the socket was last empty. Where these differ, a datagram is taken for
    as old as it can be. So it is where the kernel tells nothing: what is not before the look at the clocks was noted
    when it was read.

    Args:
        entrance: The socket, before anything can come.

    Attributes:
        stamped: Whether the kernel says when datagrams arrive.
    """

    def __init__(self, entrance: socket.socket) -> None:
        self.stamped = ask_for_times(entrance)
        self._now = self._empty = time.monotonic_ns()
        self._ahead = self._most_ahead = time.time_ns() - self._now  # of the real-time clock [ns]

    def look(self) -> None:
        """Look at the clocks; to be called before datagrams are read."""
        self._now = time.monotonic_ns()
        self._ahead = time.time_ns() - self._now
        self._most_ahead = max(self._most_ahead, self._ahead)

    def of(self, arrived: int) -> float:
        """How long a datagram had waited when it was looked at the clocks [s]; `arrived` as `receive` tells it [ns]."""
        most = self._now - self._empty
        waited = self._now + self._most_ahead - arrived
        known = arrived < self._now + self._ahead and waited < most
        return 1e-9 * (waited if known else most)

    def emptied(self) -> None:
        """There was no datagram left."""
        self._empty, self._most_ahead = self._now, self._ahead
