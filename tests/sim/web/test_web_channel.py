"""A pipe between two processes: one end writes and never waits, the other reads, and nothing goes the other way."""

from __future__ import annotations

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.sim.web.channel import Inbound, Outbound, one_way


def ends() -> tuple[Inbound, Outbound]:
    reading, writing = one_way()
    return Inbound(reading), Outbound(writing)


@given(st.lists(st.binary(max_size=3000), max_size=20))
def test_what_was_taken_arrives_whole_and_in_order(messages: list[bytes]) -> None:
    inbound, outbound = ends()
    taken = [message for message in messages if outbound.offer(message)]
    assert inbound.received() == taken
    outbound.close()
    assert inbound.received(1.0) == []
    assert inbound.closed


def test_a_reader_that_sleeps_keeps_nobody_waiting_and_gets_whole_messages_later() -> None:
    inbound, outbound = ends()
    big = os.urandom(50_000)
    taken = [k for k in range(200) if outbound.offer((k, big))]  # a writer that waited would wait for ever
    assert outbound.left_out == 200 - len(taken) > 0
    found: list[tuple[int, bytes]] = []
    while len(found) < len(taken):  # a message that was begun goes on when the next is offered
        found += inbound.received(0.01)
        outbound.offer(("more", b""))
    assert [k for k, _ in found[: len(taken)]] == taken
    assert all(data == big for _, data in found[: len(taken)])


def test_the_writer_learns_that_the_reader_has_gone_and_goes_on() -> None:
    inbound, outbound = ends()
    inbound.close()
    assert not outbound.offer("anybody?")
    assert outbound.closed
    assert not outbound.offer("still nobody?")


def test_neither_end_can_be_used_the_other_way() -> None:
    """The kernel says so: descriptors of a pipe are for reading or for writing."""
    reading, writing = one_way()
    with pytest.raises(OSError):
        os.read(writing.fileno(), 1)
    with pytest.raises(OSError):
        os.write(reading.fileno(), b"!")
    reading.close()
    writing.close()
