"""An EGM session whose robot or source cannot go on: what is answered then."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import thinned
from egm_wire import DT, START, N, Wire

from qpsafe.irc5 import messages
from qpsafe.irc5.session import Phase
from qpsafe.reference import JointReference

# row: motors off, E-stop, RAPID stopped -> hold the measured q; gate on motors, mci and RAPID state

CLOSED = [{"motors_on": False}, *({"mci": mci} for mci in messages.MCI_STATES[:3])]
CLOSED += [{"rapid": rapid} for rapid in messages.RAPID_STATES[:2]]


@pytest.mark.parametrize("states", thinned(2, CLOSED), ids=str)
def test_a_robot_that_is_not_driven_is_answered_its_own_pose(wire: Wire, states: dict) -> None:
    wire.run()
    wire.states = states
    random = np.random.default_rng(1)
    for _ in range(20):
        wire.q = random.uniform(-1.5, 1.5, N)  # moved by hand, or anyhow
        measured = wire.q.copy()
        wire.exchange()
        assert wire.session.phase == Phase.HOLDING
        assert np.allclose(wire.answers[-1].q_ref, measured, rtol=1e-12)
        assert not wire.answers[-1].qd_ref.any()
        assert wire.cycles[-1].seeded
        assert wire.cycles[-1].notes
    wire.states = {}
    since = len(wire.answers)
    wire.exchange()
    assert wire.session.phase == Phase.RAMPING
    wire.exchange(200)
    wire.check_steps(since)
    assert wire.session.phase == Phase.RUNNING


def test_a_short_emergency_stop_between_two_reads_is_not_missed(wire: Wire) -> None:
    wire.run()
    for changes in ({"motors_on": False}, {}):
        wire.pass_time()
        assert wire.offer(wire.packet(**changes))
    wire.answer()
    assert wire.cycles[-1].seeded
    assert wire.session.phase == Phase.RAMPING


def test_before_anything_runs_the_pose_is_held(wire: Wire) -> None:
    wire.states = {"mci": "stopped", "rapid": "stopped", "motors_on": False}
    wire.exchange(3)
    assert wire.session.phase == Phase.HOLDING
    assert len(wire.cycles[-1].notes) == 3


# row: start (no planner, jumps) -> start from the measured pose, ramp in


def test_a_source_that_does_not_start_at_the_measured_pose_is_not_followed(wire: Wire) -> None:
    wire.exchange(1, JointReference(0, 0.0, START + 0.5, np.zeros(N)))
    wire.exchange(5, JointReference(1, 0.0, START + 0.5, np.zeros(N)))
    assert wire.session.phase == Phase.STOPPED
    assert "joint_2 is 0.5 rad from the measured pose" in wire.session.causes[0]
    assert all(np.allclose(a.q_ref, START, atol=1e-12) and not a.qd_ref.any() for a in wire.answers)


def test_a_source_that_jumps_stops_the_robot_smoothly(wire: Wire) -> None:
    wire.run()
    since = len(wire.answers)
    wire.source.q[1] += 0.1
    wire.exchange(100)
    wire.check_steps(since - 1)
    assert wire.session.phase == Phase.STOPPED
    assert "joint_2" in wire.session.causes[0]
    assert "its last one" in wire.session.causes[0]


def test_a_source_may_go_on_while_packets_are_missed_or_references_bad(wire: Wire) -> None:
    wire.run()
    for _ in range(20):
        wire.source.step()
    wire.pass_time(20)
    wire.offer(wire.packet())
    wire.answer()
    assert wire.session.phase == Phase.RUNNING
    for _ in range(20):
        wire.exchange(1, None)
        wire.source.step()
    wire.exchange(100)
    assert wire.session.phase == Phase.RUNNING
    assert np.abs(wire.source.step().qd * DT * 20).max() > 0.02  # else nothing was tested


def test_a_source_cannot_number_a_jump_away(wire: Wire) -> None:
    wire.run()
    wire.exchange(1, JointReference(10**6, 0.0, wire.source.q + 0.5, np.zeros(N)))
    assert wire.session.phase == Phase.STOPPING


@pytest.mark.parametrize("speed", [1e3, -1e300, 50.0])
def test_a_source_that_is_too_fast_is_held_within_the_limits(wire: Wire, speed: float) -> None:
    wire.run()
    since = len(wire.answers)
    q = wire.source.q
    for k in range(100):
        wire.exchange(1, JointReference(1000 + k, 0.0, q, np.full(N, speed)))
    wire.check_steps(since - 1)
    assert wire.session.counts["clipped"] > 0
