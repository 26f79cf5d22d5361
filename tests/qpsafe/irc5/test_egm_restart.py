"""An EGM session whose robot starts again, from another port, with another clock, or whose packets are old."""

from __future__ import annotations

import numpy as np
from egm_wire import DT, PEER, START, Wire

from qpsafe.irc5.session import Phase

# row: stale or duplicate seqno -> drop older ones (mod 2^32)


def test_old_and_repeated_packets_are_dropped(wire: Wire) -> None:
    wire.run()
    old, older = wire.packet(), wire.packet(seq=wire.seq - 1, clock=wire.clock - DT)
    accepted = wire.session.counts["accepted"]
    state = (wire.session.phase, wire.session.q.copy())
    assert not wire.offer(old)
    assert not wire.offer(older)
    assert wire.answer() is None
    assert (wire.session.counts["duplicate"], wire.session.counts["stale"]) == (1, 1)
    assert wire.session.counts["accepted"] == accepted
    assert state[0] == wire.session.phase
    assert np.array_equal(state[1], wire.session.q)


def test_reordered_packets_never_go_back(wire: Wire) -> None:
    wire.run()
    late = []
    for _ in range(4):
        wire.pass_time()
        late.append(wire.packet())
    for k, accepted in ((1, True), (0, False), (3, True), (2, False)):
        assert wire.offer(late[k]) == accepted
    wire.answer()
    assert wire.cycles[-1].packet.seq == wire.seq


def test_numbers_wrap_around(wire: Wire) -> None:
    wire.seq = 2**32 - 120
    wire.run()
    assert wire.seq < 120
    assert wire.session.counts["restarts"] == wire.session.counts["missed"] == 0
    assert sum(cycle.seeded for cycle in wire.cycles) == 1
    assert not wire.offer(wire.packet(seq=2**32 - 1, clock=wire.clock - 1.0))
    assert wire.session.counts["stale"] == 1
    wire.check_steps()


# row: robot restarts (seqno 0) -> re-seed from feedback, ramp in


def test_a_restart_seeds_anew_and_ramps_in(wire: Wire) -> None:
    wire.run()
    wire.seq, wire.q = -1, START + 0.2
    wire.exchange()
    assert wire.seq == 0
    assert wire.cycles[-1].seeded
    assert "the robot started anew" in wire.cycles[-1].notes
    assert wire.session.phase == Phase.RAMPING
    assert np.allclose(wire.answers[-1].q_ref, START + 0.2, atol=1e-5)
    assert wire.session.counts["restarts"] == 1
    since = len(wire.answers)
    wire.exchange(200)
    wire.check_steps(since - 1)
    assert wire.session.phase == Phase.RUNNING


def test_a_restart_is_told_from_a_delayed_first_packet(wire: Wire) -> None:
    """Both have number 0; what was only delayed bears an older clock."""
    wire.seq = -1
    wire.pass_time()
    first = wire.packet()
    assert wire.offer(first)
    wire.answer()
    wire.exchange(3)
    assert not wire.offer(first)
    assert wire.session.counts["restarts"] == 0
    wire.seq = -1
    wire.exchange()
    assert wire.session.counts["restarts"] == 1


def test_a_restart_whose_first_packets_are_lost(wire: Wire) -> None:
    wire.run()
    wire.seq = 17
    wire.exchange()
    assert wire.session.counts["restarts"] == 1
    assert wire.cycles[-1].seeded


def test_a_restart_of_the_whole_controller_with_its_clock_set_back(wire: Wire) -> None:
    """Only after a silence, and when several packets in a row say so."""
    wire.run()
    wire.pass_time(int(2.0 / DT))
    wire.seq, wire.clock = -1, 3.0
    for accepted in (False, False, True):
        wire.pass_time()
        assert wire.offer(wire.packet()) == accepted
    assert wire.answer() is not None
    assert wire.cycles[-1].seeded
    wire.exchange(10)
    assert wire.session.counts["restarts"] == 1


def test_a_robot_may_come_back_from_another_port_after_a_silence(wire: Wire) -> None:
    wire.run()
    wire.pass_time()
    other = (PEER[0], 6000)
    assert not wire.offer(wire.packet(), other)
    wire.pass_time(int(1.5 / DT))
    assert not wire.offer(wire.packet(), ("127.0.0.9", 5000))
    assert wire.offer(wire.packet(seq=0), other)
    wire.answer()
    assert wire.cycles[-1].seeded
    assert wire.session.sender == other
