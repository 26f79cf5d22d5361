"""An EGM session without a socket: how it goes when nothing is wrong, and when packets are lost."""

from __future__ import annotations

import numpy as np
import pytest
from egm_wire import DT, START, Wire

from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.session import Phase

# the way it goes when nothing is wrong


def test_the_start_is_the_measured_pose_at_rest_then_the_source_is_blended_in(wire: Wire) -> None:
    wire.exchange()
    assert wire.cycles[0].seeded
    assert wire.session.phase == Phase.RAMPING
    assert np.allclose(wire.answers[0].q_ref, START, atol=1e-6)
    ticks = int(SessionRules().ramp_in / DT)
    for _ in range(ticks):
        wire.exchange()
        assert not wire.cycles[-1].seeded
    assert wire.session.phase == Phase.RUNNING
    wire.check_steps()


def test_once_blended_in_the_source_is_what_is_sent(wire: Wire) -> None:
    wire.run()
    for _ in range(300):
        wire.exchange()
        assert np.allclose(wire.answers[-1].q_ref, wire.source.q, rtol=0, atol=1e-12)
    assert wire.session.counts["clipped"] == 0
    wire.check_steps()


def test_blending_is_the_weighted_mean_of_seed_and_source(wire: Wire) -> None:
    ticks = int(SessionRules().ramp_in / DT)
    for k in range(1, ticks + 1):
        wire.exchange()
        s = k / ticks
        w = s * s * (3.0 - 2.0 * s)
        assert np.allclose(wire.answers[-1].q_ref, START + w * (wire.source.q - START), rtol=0, atol=1e-9)
        assert (wire.session.phase == Phase.RUNNING) == (k == ticks)


def test_every_packet_is_answered_exactly_once(wire: Wire) -> None:
    wire.pass_time()
    assert wire.session.take() is None
    assert wire.session.answer(None) is None
    assert wire.offer(wire.packet())
    assert wire.answer() is not None
    assert wire.session.take() is None
    assert wire.session.answer(None) is None
    wire.exchange(50)
    assert wire.session.counts["answered"] == wire.session.counts["accepted"] == 51
    assert [a.seq for a in wire.answers] == list(range(51))


def test_of_several_packets_the_newest_is_answered(wire: Wire) -> None:
    wire.run()
    for _ in range(3):
        wire.pass_time()
        assert wire.offer(wire.packet())
    wire.answer()
    assert wire.cycles[-1].packet.seq == wire.seq
    assert wire.cycles[-1].missed == 2
    assert wire.session.counts["superseded"] == 2
    assert wire.answer() is None


def test_measured_speed_is_that_of_the_robots_clock(wire: Wire) -> None:
    wire.run()
    before = wire.cycles[-1].packet.q
    wire.seq, wire.time, wire.clock = wire.seq + 1, wire.time + 0.02, wire.clock + 0.005
    wire.q = before + 0.001
    wire.offer(wire.packet())
    assert np.allclose(wire.session.take().qd, (wire.q - before) / 0.005, rtol=1e-9)


@pytest.mark.parametrize("step", [0.0, -1.0, 60.0])
def test_measured_speed_survives_a_clock_that_stands_or_jumps(wire: Wire, step: float) -> None:
    wire.run()
    before = wire.cycles[-1].packet.q
    wire.pass_time(2)
    wire.clock += step - 2 * DT
    wire.offer(wire.packet())
    assert np.allclose(wire.session.take().qd, (wire.q - before) / (2 * DT), rtol=1e-9)


# row: lost or late reply -> every speedRef with a position; speedRef to 0 before stopping


def test_a_lost_packet_leaves_no_jump(wire: Wire) -> None:
    wire.run()
    since = len(wire.answers)
    random = np.random.default_rng(0)
    for _ in range(300):
        wire.pass_time(int(random.integers(1, 6)))
        wire.offer(wire.packet())
        wire.q = wire.answer().q_ref
    wire.check_steps(since - 1)
    assert wire.session.counts["missed"] > 300
    assert wire.session.phase == Phase.RUNNING


def test_a_stop_ramps_the_speed_to_zero_and_holds(wire: Wire) -> None:
    wire.run()
    wire.session.stop("a person asked for it")
    assert wire.session.phase == Phase.STOPPING
    since = len(wire.answers)
    while wire.session.phase == Phase.STOPPING:
        wire.exchange()
        assert len(wire.answers) < 2000
    wire.check_steps(since - 1)
    assert not wire.answers[-1].qd_ref.any()
    assert len(wire.answers) - since >= SessionRules().ramp_out / DT - 1
    held = wire.answers[-1].q_ref
    wire.exchange(50)
    assert all(np.array_equal(a.q_ref, held) and not a.qd_ref.any() for a in wire.answers[-50:])
    assert wire.session.at_rest
    assert "a person asked for it" in wire.cycles[-1].notes[-1]


def test_braking_keeps_the_direction(wire: Wire) -> None:
    wire.run()
    speed = wire.answers[-1].qd_ref.copy()
    wire.session.stop("")
    while wire.session.phase == Phase.STOPPING:
        wire.exchange()
        now = wire.answers[-1].qd_ref
        assert np.allclose(np.cross(now, speed), 0.0, atol=1e-9)
        assert now @ speed >= 0.0


def test_only_an_acknowledgement_ends_a_stop(wire: Wire) -> None:
    wire.run()
    assert not wire.session.acknowledge()  # nothing to acknowledge
    assert wire.session.phase == Phase.RUNNING
    wire.session.stop("why")
    assert not wire.session.acknowledge()  # not before it stands
    wire.exchange(300)
    assert (wire.session.phase, wire.session.causes) == (Phase.STOPPED, ("why",))
    for states in ({"motors_on": False}, {}):
        wire.states = states
        wire.exchange(3)
        assert wire.session.phase == Phase.STOPPED
    assert wire.session.acknowledge()
    wire.exchange()
    assert wire.cycles[-1].seeded
    assert (wire.session.phase, wire.session.causes) == (Phase.RAMPING, ())
    wire.exchange(200)
    assert wire.session.phase == Phase.RUNNING


def test_after_a_silence_the_robot_is_seeded_anew(wire: Wire) -> None:
    wire.run()
    wire.pass_time(int(1.1 / DT))
    assert wire.offer(wire.packet())
    wire.answer()
    assert wire.cycles[-1].seeded
    assert wire.session.phase == Phase.RAMPING
