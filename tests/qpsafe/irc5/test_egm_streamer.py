"""The streamer's socket: one answer a packet, from the newest; only where it listens; at rest before it is silent."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.irc5 import streamer as module
from qpsafe.irc5.messages import MAX_SIZE, RobotPacket, SensorPacket, decode_sensor, encode_robot
from qpsafe.irc5.session import Phase
from qpsafe.irc5.streamer import EgmStreamer
from qpsafe.irc5.transport.addresses import interface_address, peer_address
from qpsafe.limits import JointLimits

ROBOT = qpsafe.load_robot("irb140")
LIMITS = JointLimits(ROBOT.lower, ROBOT.upper, ROBOT.max_velocity, ROBOT.max_acceleration, 0.004)
N = ROBOT.nq


class Client:
    """A robot's socket; what it says is in step with what it was answered."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(5.0)
        self.address = address
        self.seq, self.q = -1, ROBOT.home.copy()

    def say(self, **changes: object) -> None:
        self.seq += 1
        values: dict = {"q": self.q, "clock": 50.0 + 0.004 * self.seq, **changes}
        self.send(encode_robot(RobotPacket(self.seq, 4 * self.seq, **values)))

    def send(self, data: bytes) -> None:
        self.socket.sendto(data, self.address)

    def hear(self) -> SensorPacket:
        answer = decode_sensor(self.socket.recv(MAX_SIZE), N)
        self.q = answer.q_ref
        return answer

    def silent(self) -> bool:
        """Nothing more has been said to it."""
        self.socket.setblocking(False)
        try:
            self.socket.recv(MAX_SIZE)
        except BlockingIOError:
            return True
        finally:
            self.socket.settimeout(5.0)
        return False


@pytest.fixture
def streamer() -> Iterator[EgmStreamer]:
    made = EgmStreamer(LIMITS, port=0, joint_names=ROBOT.joint_names)
    yield made
    made.close()


@pytest.fixture
def client(streamer: EgmStreamer) -> Iterator[Client]:
    made = Client(streamer.address)
    yield made
    made.socket.close()


def test_each_packet_is_answered_once(streamer: EgmStreamer, client: Client) -> None:
    for k in range(50):
        client.say()
        cycle = streamer.wait(5.0)
        assert cycle is not None
        assert cycle.packet.seq == k
        assert streamer.answer(None)
        assert not streamer.answer(None)
        assert client.hear().seq == k
    assert client.silent()
    assert streamer.wait(0.0) is None
    assert streamer.counts["answered"] == streamer.counts["accepted"] == 50


def test_a_response_is_counted_from_the_oldest_packets_arrival(streamer: EgmStreamer, client: Client) -> None:
    """Waiting in the kernel before it was read is part of it, and what a newer packet superseded still waited."""
    if not streamer.stamped:
        pytest.skip("this kernel does not say when datagrams arrived")
    client.say()  # a busy kernel takes a while before it stamps what arrives: until then reading does
    assert streamer.wait(5.0) is not None
    assert streamer.answer(None)
    time.sleep(0.1)
    for packets in (2, 1):
        before = time.time_ns()
        client.say()
        said = time.time_ns()
        for _ in range(packets - 1):
            time.sleep(0.02)
            client.say()
        assert streamer.wait(5.0) is not None
        ready = time.time_ns()
        assert streamer.answer(None)
        after = time.time_ns()
        assert 1e-9 * (ready - said) <= streamer.response <= 1e-9 * (after - before)


def test_the_newest_of_many_is_answered_and_junk_is_passed_over(streamer: EgmStreamer, client: Client) -> None:
    for _ in range(20):
        client.say()
        client.send(b"junk")
    client.send(b"\x0a" * 60000)
    cycle = streamer.wait(5.0)
    assert cycle is not None
    assert cycle.packet.seq == 19
    streamer.answer(None)
    client.hear()
    assert client.silent()
    assert (streamer.counts["superseded"], streamer.counts["garbage"]) == (19, 21)


def test_junk_alone_does_not_end_the_wait(streamer: EgmStreamer, client: Client) -> None:
    for _ in range(2 * module.MOST_AT_ONCE):
        client.send(b"junk")
    assert streamer.wait(0.05) is None
    assert streamer.counts["garbage"] > 0
    assert not streamer.answer(None)


def test_waiting_blocks_until_the_robot_speaks(streamer: EgmStreamer, client: Client) -> None:
    later = threading.Timer(0.1, client.say)
    later.start()
    assert streamer.wait(5.0) is not None
    later.join()


def test_a_second_robot_is_not_answered(streamer: EgmStreamer, client: Client) -> None:
    other = Client(streamer.address)
    client.say()
    assert streamer.wait(5.0) is not None
    streamer.answer(None)
    other.say()
    client.say()
    cycle = streamer.wait(5.0)
    assert cycle is not None
    streamer.answer(None)
    assert client.hear().seq == 0
    assert client.hear().seq == 1
    assert other.silent()
    assert streamer.counts["wrong_sender"] == 1
    other.socket.close()


def test_a_controller_drives_the_robot(streamer: EgmStreamer, client: Client) -> None:
    """The loop of the docstring: once ramped in, the robot is sent what the controller says."""
    goal = ROBOT.pose("tcp", ROBOT.home).copy()
    goal[1, 3] += 0.05
    controller = qpsafe.SafetyController(ROBOT, [qpsafe.PositionTask("tcp", qpsafe.FixedPose(goal))])
    for _ in range(600):
        client.say()
        cycle = streamer.wait(5.0)
        assert cycle is not None
        if cycle.seeded:
            controller.reset()
        tick = controller.step(cycle.packet.q, cycle.qd, points=np.zeros((0, 3)))
        streamer.answer(tick.reference)
        answer = client.hear()
    assert streamer.phase == Phase.RUNNING
    assert np.allclose(answer.q_ref, tick.reference.q, rtol=0, atol=1e-12)
    assert np.allclose(answer.qd_ref, tick.reference.qd, rtol=0, atol=1e-10)
    assert np.linalg.norm(ROBOT.pose("tcp", client.q)[:3, 3] - goal[:3, 3]) < 0.01
    assert streamer.counts["clipped"] == streamer.counts["bad_reference"] == 0


def robot_thread(client: Client, heard: list[SensorPacket], end: threading.Event) -> None:
    while not end.is_set():
        client.say()
        try:
            heard.append(client.hear())
        except TimeoutError:
            return


def test_leaving_the_block_first_brings_the_robot_to_rest() -> None:
    heard: list[SensorPacket] = []
    end = threading.Event()

    def drive() -> None:
        with EgmStreamer(LIMITS, port=0) as streamer:
            client = Client(streamer.address)
            client.socket.settimeout(0.5)
            thread = threading.Thread(target=robot_thread, args=(client, heard, end))
            threads.append((thread, client))
            thread.start()
            source = None
            for k in range(300):
                cycle = streamer.wait(5.0)
                assert cycle is not None
                source = cycle.packet.q if cycle.seeded else source
                qd = np.full(N, 0.3) * min(k / 100.0, 1.0)
                source = source + qd * 0.004
                streamer.answer(qpsafe.JointReference(k, 0.0, source, qd))
            raise RuntimeError("something else failed")

    threads: list[tuple[threading.Thread, Client]] = []
    with pytest.raises(RuntimeError, match="something else"):
        drive()
    ((thread, client),) = threads
    end.set()
    thread.join()
    client.socket.close()
    assert np.abs(heard[299].qd_ref).max() > 0.29
    assert len(heard) > 330
    assert not heard[-1].qd_ref.any()
    speeds = np.array([a.qd_ref for a in heard])
    assert (np.abs(np.diff(speeds, axis=0)) <= LIMITS.max_acceleration * 0.004 * (1 + 1e-9)).all()


def test_finishing_gives_up_when_the_robot_is_silent(streamer: EgmStreamer, client: Client) -> None:
    client.say()
    assert streamer.wait(5.0) is not None
    streamer.answer(None)
    assert streamer.phase == Phase.RAMPING
    assert not streamer.finish(patience=0.01)


def test_it_listens_on_one_address_only(streamer: EgmStreamer) -> None:
    assert streamer.address[0] == "127.0.0.1"
    elsewhere = Client(("127.0.0.2", streamer.address[1]))
    elsewhere.say()
    assert streamer.wait(0.05) is None
    assert not streamer.counts
    elsewhere.socket.close()


def test_an_interface_by_name() -> None:
    assert interface_address("lo") == "127.0.0.1"
    assert interface_address("localhost") == "127.0.0.1"


@pytest.mark.parametrize("host", ["", "0.0.0.0", "255.255.255.255", "no such host", "192.0.2.1"])
def test_a_wrong_host_is_refused_by_name(host: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        EgmStreamer(LIMITS, host=host, port=0)
    assert caught.value.key == "host"
    assert "an address" in str(caught.value)


@pytest.mark.parametrize("peer", ["", "0.0.0.0", "255.255.255.255", "no such robot", "a" * 300, "::1"])
def test_a_peer_that_nobody_can_be_is_refused_by_name(peer: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        EgmStreamer(LIMITS, peer=peer, port=0)
    assert (caught.value.key, caught.value.value) == ("peer", peer)


def test_a_peer_may_be_named() -> None:
    assert peer_address("localhost") == peer_address("127.0.0.1") == "127.0.0.1"


def test_a_taken_or_wrong_port_is_refused_by_name(streamer: EgmStreamer) -> None:
    with pytest.raises(ConfigurationError, match="in use"):
        EgmStreamer(LIMITS, port=streamer.address[1])
    for port in (-1, 70000, "6510", None):
        with pytest.raises(ConfigurationError) as caught:
            EgmStreamer(LIMITS, port=port)  # type: ignore[arg-type]
        assert caught.value.key == "port"
