"""Hosts and ports that a person names, as IPv4 addresses; looked up once, when a part is made, never in the loop."""

from __future__ import annotations

import socket
import struct
from typing import Any

from qpsafe.errors import ConfigurationError
from qpsafe.text.given import whole


def udp_port(where: str, port: Any, least: int = 0) -> int:
    """A UDP port; 0, if that is allowed, stands for any free one.

    Args:
        where: Who asks, for the error.
        port: As given.
        least: 0 to listen, 1 to send.

    Raises:
        ConfigurationError: It is none.
    """
    return whole(where, "port", port, f"a UDP port, {least} to 65535", least, 65535)


def host_address(where: str, key: str, host: Any) -> str:
    """The IPv4 address of a host name or address, also one that stands for all or nobody.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        host: As given.

    Raises:
        ConfigurationError: There is none.
    """
    address = _found(host)
    if address is None:
        raise ConfigurationError(where, key, host, "an IPv4 address, e.g. 127.0.0.1, or a host name that has one")
    return address


def interface_address(host: Any, where: str = "EgmStreamer") -> str:
    """The IPv4 address of a host name or address of this computer, or of one of its network interfaces by name.

    Args:
        host: As given.
        where: Who asks, for the error.

    Raises:
        ConfigurationError: There is none, or it stands for all interfaces.
    """
    names = [name for _, name in socket.if_nameindex()]
    if isinstance(host, str) and host in names:
        import fcntl  # not on Windows, where interfaces are given by address

        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            request = struct.pack("256s", host.encode()[:15])
            try:
                answer = fcntl.ioctl(probe.fileno(), 0x8915, request)  # SIOCGIFADDR
            except OSError as error:
                raise ConfigurationError(where, "host", host, f"an interface with an address ({error})") from None
        return socket.inet_ntoa(answer[20:24])
    address = _of_somebody(host)
    if address is None:
        expected = "an address of this computer, or one of its interfaces: "
        raise ConfigurationError(where, "host", host, expected + ", ".join(names))
    return address


def peer_address(peer: Any, where: str = "EgmStreamer") -> str:
    """The IPv4 address of a host name or address, as packets from there bear it.

    Args:
        peer: As given.
        where: Who asks, for the error.

    Raises:
        ConfigurationError: There is none, or it is that of nobody: all packets would be a stranger's.
    """
    address = _of_somebody(peer)
    if address is None:
        expected = "the IPv4 address that packets come from, e.g. 192.168.125.1, or the name of that host"
        raise ConfigurationError(where, "peer", peer, expected)
    return address


def _of_somebody(name: Any) -> str | None:
    address = _found(name)
    return None if address in ("0.0.0.0", "255.255.255.255") else address


def _found(name: Any) -> str | None:
    """The IPv4 address of a name or an address; None where there is none."""
    if not isinstance(name, str) or not name:
        return None
    try:
        return socket.gethostbyname(name)
    except (OSError, ValueError, TypeError):  # also names that are too long, or have a zero in them
        return None
