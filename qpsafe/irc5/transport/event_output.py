"""Names of a task program's events to whoever acts on them, e.g. a gripper: one UDP datagram of ASCII text each."""

from __future__ import annotations

import socket
from contextlib import suppress

from qpsafe.errors import ConfigurationError


def address(text: str) -> tuple[str, int]:
    """Host and port from "HOST:PORT".

    Raises:
        ConfigurationError: It is none.
    """
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ConfigurationError("address", "HOST:PORT", text, "e.g. 127.0.0.1:6512")
    return host, int(port)


class EventOutput:
    """Sends names of events.

    Args:
        where: "HOST:PORT".

    Raises:
        ConfigurationError: It is no address.
    """

    def __init__(self, where: str) -> None:
        self._address = address(where)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, names: list[str]) -> None:
        """One datagram a name; nobody listening is no error."""
        for name in names:
            with suppress(OSError):
                self._socket.sendto(name.encode("ascii", "replace"), self._address)
