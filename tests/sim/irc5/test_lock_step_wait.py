"""In lock-step the robot waits for whoever answers: also for one that begins later, and no longer than it is wanted."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from amounts import first

from qpsafe.irc5.distances import decode
from qpsafe.irc5.messages import RobotPacket, SensorPacket, decode_robot, encode_sensor
from qpsafe.irc5.transport.axes import axes_of
from qpsafe.sim.irc5.udp import NoAnswerError, UdpExchange

pytestmark = pytest.mark.long

AXES = axes_of(6)
PACKET = RobotPacket(7, 100, np.linspace(-1.0, 1.0, 6), clock=0.1)


class Late:
    """One that opens its port after a while, and answers the first packet that it hears."""

    def __init__(self, after: float) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.address: tuple[str, int] = probe.getsockname()
        self.after = after
        self.heard: list[RobotPacket] = []
        self.sensors = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sensors.bind(("127.0.0.1", 0))
        self.thread = threading.Thread(target=self.answer, daemon=True)
        self.thread.start()

    def answer(self) -> None:
        time.sleep(self.after)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            wire.bind(self.address)
            wire.settimeout(30.0)
            data, sender = wire.recvfrom(4096)
            self.heard.append(decode_robot(data, AXES))
            wire.sendto(encode_sensor(SensorPacket(0, 0, PACKET.q, np.zeros(6)), AXES), sender)


@pytest.mark.parametrize("after", [0.0, 0.2, 0.7, 1.3])
def test_the_first_packet_reaches_one_that_begins_later(after: float) -> None:
    """A datagram to a port that nobody has opened is lost: packet and distances are sent again, as they were."""
    other = Late(after)
    exchange = UdpExchange(6, other.address, other.sensors.getsockname(), lockstep=0.05, patience=30.0)
    answers, _ = exchange.swap(PACKET, np.array([0.3, 0.4]))
    other.thread.join(30.0)
    np.testing.assert_array_equal([answer.q_ref for answer in answers], [PACKET.q])
    assert [(one.seq, one.clock) for one in other.heard] == [(PACKET.seq, PACKET.clock)]
    np.testing.assert_array_equal(other.heard[0].q, PACKET.q)
    sensed = decode(other.sensors.recv(4096), 2)
    assert sensed is not None
    np.testing.assert_array_equal(sensed.values, [0.3, 0.4])
    started = time.monotonic()
    with pytest.raises(NoAnswerError):  # who has answered once is waited for as long as was said, and not asked twice
        exchange.swap(PACKET, np.array([0.3, 0.4]))
    assert time.monotonic() - started < 5.0
    exchange.close()
    other.sensors.close()


def test_what_is_no_answer_ends_no_wait() -> None:
    """Garbage before the first answer is counted, and the patience for that stays."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        exchange = UdpExchange(6, other.getsockname(), lockstep=0.05, patience=30.0)

        def answer() -> None:
            _, sender = other.recvfrom(4096)
            other.sendto(b"garbage", sender)
            time.sleep(0.4)
            other.sendto(encode_sensor(SensorPacket(0, 0, PACKET.q, np.zeros(6)), AXES), sender)

        thread = threading.Thread(target=answer, daemon=True)
        thread.start()
        answers, _ = exchange.swap(PACKET, np.zeros(0))
        thread.join(30.0)
        assert (len(answers), exchange.rejected) == (1, 1)
        exchange.close()


def test_who_is_no_longer_wanted_does_not_wait() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        wanted = threading.Event()
        exchange = UdpExchange(6, silent.getsockname(), lockstep=60.0, over=wanted.is_set)
        threading.Timer(0.3, wanted.set).start()
        started = time.monotonic()
        assert exchange.swap(PACKET, np.zeros(0))[0] == []
        assert 0.2 < time.monotonic() - started < 20.0
        exchange.close()


@pytest.mark.parametrize("number", first(1, [signal.SIGINT, signal.SIGTERM]))
def test_a_signal_ends_a_robot_that_nobody_answers(number: int) -> None:
    """It was heard after a minute, when the robot had given up by itself."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        silent.settimeout(120.0)
        command = [sys.executable, "-c", "from qpsafe.cli.main import main; main()", "irc5-sim", "--lock-step"]
        command += ["--port", str(silent.getsockname()[1]), "--sensor-port", "0", "--event-port", "0"]
        robot = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        silent.recv(4096)  # it is at work
        robot.send_signal(number)
        started = time.monotonic()
        said, complaint = robot.communicate(timeout=100.0)
    assert time.monotonic() - started < 30.0  # and not after its patience of 180 s
    assert robot.returncode == 1, complaint  # nothing was answered
    assert "Traceback" not in complaint + said
