"""Two independent clients read what we send, and we read what they send."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from amounts import first, some

import qpsafe
from qpsafe.irc5.messages import MAX_SIZE, MCI_STATES, RAPID_STATES, RobotPacket, decode_sensor, encode_robot
from qpsafe.irc5.session import Phase
from qpsafe.irc5.streamer import EgmStreamer
from qpsafe.limits import JointLimits

SCRIPT = Path(__file__).with_name("egm_peer.py")
PEERS = ("ABBRobotEGM", "abb-robot-client")
EXCHANGES = some(500, of=5000)
N = 6


def start(*arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("peer", first(1, PEERS))
def test_a_peer_as_the_pc_reads_our_robot_and_we_read_its_answers(peer: str) -> None:
    process = start(peer, "pc", EXCHANGES)
    random = np.random.default_rng(EXCHANGES)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.settimeout(20)
        robot.bind(("127.0.0.1", 0))
        assert process.stdout is not None
        port = int(process.stdout.readline())
        for _ in range(EXCHANGES):
            q = random.uniform(-7.0, 7.0, N)
            seq, micros = int(random.integers(2**32)), int(random.integers(4 * 10**15))
            on, mci, rapid, converged = (int(random.integers(k)) for k in (2, 4, 3, 2))
            states = (bool(on), MCI_STATES[mci], RAPID_STATES[rapid], bool(converged))
            packet = RobotPacket(seq, seq, q, q, *states, clock=micros / 1e6)
            robot.sendto(encode_robot(packet), ("127.0.0.1", port))
            answer = decode_sensor(robot.recv(MAX_SIZE), N)
            assert np.allclose(answer.q_ref, q, rtol=1e-15, atol=0)
            echo = [
                float(on),
                float(rapid == 2),
                float(mci),
                float(seq % 1000),
                float(micros % 1_000_000),
                float(converged),
            ]
            assert np.allclose(np.rad2deg(answer.qd_ref), echo, rtol=1e-14, atol=0)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors


@pytest.mark.parametrize("peer", first(1, PEERS))
def test_a_robot_that_speaks_with_a_peers_messages_is_driven(peer: str) -> None:
    """It goes where it is sent, so that what we read is what we sent before, through both codes."""
    robot = qpsafe.load_robot("irb140")
    limits = JointLimits(robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, 0.004)
    streamer = EgmStreamer(limits, port=0)
    process = start(peer, "robot", EXCHANGES, streamer.address[1])
    source = robot.home
    for k in range(EXCHANGES):
        cycle = streamer.wait(60.0)
        assert cycle is not None
        assert cycle.packet.seq == k
        assert cycle.packet.clock == (1_700_000_000_000_000 + 4000 * k) / 1e6
        assert np.allclose(cycle.packet.q, source if k == 0 else streamer.session.q, rtol=0, atol=1e-14)
        qd = np.full(N, 0.3 * np.sin(0.01 * k))
        source = source + qd * 0.004
        assert streamer.answer(qpsafe.JointReference(k, 0.004 * k, source, qd))
    out, errors = process.communicate(timeout=60)
    streamer.close()
    assert process.returncode == 0, errors
    assert np.allclose(np.deg2rad(json.loads(out)), source, rtol=0, atol=1e-12)
    assert streamer.phase == Phase.RUNNING
    assert set(+streamer.counts) == {"accepted", "answered"}
    assert streamer.counts["answered"] == EXCHANGES
