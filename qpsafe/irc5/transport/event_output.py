"""Names of a task program's events to whoever acts on them, e.g. a gripper: one UDP datagram of ASCII text each."""

from __future__ import annotations

import socket
from contextlib import suppress

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.transport.addresses import host_address


def address(text: str, where: str = "address") -> tuple[str, int]:
    """Host and port from "HOST:PORT".

    Args:
        text: As given.
        where: Who asks, for the error.

    Raises:
        ConfigurationError: It is none.
    """
    host, _, port = text.rpartition(":") if isinstance(text, str) else ("", "", "")
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ConfigurationError(where, "HOST:PORT", text, "e.g. 127.0.0.1:6512")
    return host, int(port)


class EventOutput:
    """Sends names of events.

    Args:
        where: "HOST:PORT".

    Raises:
        ConfigurationError: It is no address, or there is no such host.
    """

    def __init__(self, where: str) -> None:
        host, port = address(where, "EventOutput")
        self._address = host_address("EventOutput", "HOST:PORT", host), port
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, names: list[str]) -> None:
        """One datagram a name; nobody listening is no error."""
        for name in names:
            with suppress(OSError):
                self._socket.sendto(name.encode("ascii", "replace"), self._address)
