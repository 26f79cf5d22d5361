"""Names of events go out one by one; an address that is none is named."""

import socket

import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.transport.event_output import EventOutput, address


def test_one_datagram_a_name() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gripper:
        gripper.bind(("127.0.0.1", 0))
        gripper.settimeout(30.0)
        output = EventOutput(f"127.0.0.1:{gripper.getsockname()[1]}")
        output.send(["grip", "größer"])
        assert [gripper.recv(100), gripper.recv(100)] == [b"grip", b"gr??er"]
    output.send(["nobody", "listens", "any more"])  # no error


@pytest.mark.parametrize("text", ["", "nowhere", "host:", ":5", "host:0", "host:65536", "host:-1", "host:x"])
def test_what_is_no_address_is_named(text: str) -> None:
    with pytest.raises(ConfigurationError, match="HOST:PORT"):
        address(text)
    assert address("10.0.0.1:6512") == ("10.0.0.1", 6512)
