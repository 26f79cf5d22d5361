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
