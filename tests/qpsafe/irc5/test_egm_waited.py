"""How long packets waited unread, as while the loop was suspended: the newest is answered, and its age is told."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from threading import Timer

import numpy as np
import pytest
from amounts import some
from egm_wire import LIMITS, N
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.irc5.messages import RobotPacket, encode_robot
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.session import Cycle, EgmSession, Phase
from qpsafe.irc5.streamer import EgmStreamer

PEER = ("127.0.0.1", 6599)
SILENCE = 0.2
RULES = SessionRules(silence=SILENCE, lag=0.05)


def packet(k: int) -> bytes:
    return encode_robot(RobotPacket(k, 4 * k, np.zeros(N), clock=50.0 + 0.004 * k))


class Robot:
    """Speaks to a streamer of its own."""

    def __init__(self) -> None:
        self.streamer, self.k = EgmStreamer(LIMITS, port=0, rules=RULES), -1
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def say(self, count: int = 1) -> None:
        for _ in range(count):
            self.k += 1
            self.socket.sendto(packet(self.k), self.streamer.address)

    def answered(self, timeout: float = 5.0) -> Cycle | None:
        cycle = self.streamer.wait(timeout)
        self.streamer.answer(None)
        return cycle

    def close(self) -> None:
        self.socket.close()
        self.streamer.close()


@pytest.fixture
def robot() -> Iterator[Robot]:
    made = Robot()
    if not made.streamer.stamped:
        pytest.skip("this kernel does not say when datagrams arrived")
    made.say()  # a busy kernel takes a while before it stamps what arrives
    assert made.answered() is not None
    time.sleep(0.1)
    yield made
    made.close()


@pytest.mark.parametrize("packets", [1, 10])
def test_what_waited_in_the_socket_is_as_old_as_it_is(robot: Robot, packets: int) -> None:
    robot.say(packets)
    time.sleep(0.1)
    cycle = robot.answered()
    assert cycle is not None
    assert cycle.packet.seq == robot.k
    assert 0.1 <= cycle.waited < SILENCE
    assert "waited unread" in " ".join(cycle.notes)


@pytest.mark.parametrize("packets", [1, 10, 1000])
def test_what_waited_for_longer_than_the_silence_is_not_answered_and_the_next_is_a_new_start(
    robot: Robot, packets: int
) -> None:
    """1000 are more than a socket holds: the system drops the newest, so that the robot seems older than it is."""
    robot.say(packets)
    time.sleep(SILENCE + 0.05)
    assert robot.answered(0.02) is None
    assert robot.streamer.counts["late"] >= 1
    assert robot.streamer.counts["answered"] == 1
    robot.say()
    cycle = robot.answered()
    assert cycle is not None
    assert cycle.packet.seq == robot.k
    assert cycle.seeded
    assert cycle.waited < 0.1


def test_a_robot_that_speaks_while_the_loop_is_suspended_is_answered_from_its_newest(robot: Robot) -> None:
    for _ in range(60):
        robot.say()
        time.sleep(0.005)
    cycle = robot.answered()
    assert cycle is not None
    assert cycle.packet.seq == robot.k
    assert not cycle.seeded
    assert cycle.waited < 0.1


def test_who_waits_for_the_very_first_answer_gets_it_however_late() -> None:
    """As a robot in lock-step does that was started before the stream was."""
    made = Robot()
    try:
        made.say()
        time.sleep(SILENCE + 0.05)
        assert made.answered() is not None
    finally:
        made.close()


def test_waiting_for_long_makes_nothing_that_comes_then_any_older(robot: Robot) -> None:
    """It arrives while the streamer waits, or reads: neither counts as waiting unread."""
    later = Timer(0.4, robot.say, [5])
    later.start()
    cycle = robot.answered()
    later.join()
    assert cycle is not None
    assert cycle.waited < 0.1


WAITS = st.floats(0.0, 3.0 * SILENCE) | st.sampled_from([0.0, SILENCE])


@settings(max_examples=some(60, of=500))
@given(st.lists(st.lists(WAITS, min_size=1, max_size=4), min_size=1, max_size=8))
def test_after_the_first_answer_nothing_older_than_the_silence_is_answered(looks: list[list[float]]) -> None:
    """Looks at a socket one second apart, in each some packets, the newest the last: told, and answered or counted."""
    session, k = EgmSession(LIMITS, RULES), 0
    for number, waits in enumerate(looks):
        for waited in sorted(waits, reverse=True):
            assert session.offer(packet(k), PEER, float(number), waited)
            k += 1
        late = min(waits) > SILENCE and session.counts["answered"] > 0
        counted = session.counts["late"]
        cycle = session.take()
        assert (cycle is None) == late
        assert session.counts["late"] == counted + late
        assert (session.answer(None) is None) == late
        assert cycle is None or (cycle.waited == min(waits) and cycle.packet.seq == k - 1)
    assert session.phase in (Phase.RAMPING, Phase.RUNNING)
