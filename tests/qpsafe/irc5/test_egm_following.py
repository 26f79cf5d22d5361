"""An EGM session whose robot does not follow, or is given no reference."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import first, some
from egm_wire import A_MAX, DT, START, V_MAX, N, Source, Wire
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.irc5 import messages
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.session import Phase
from qpsafe.reference import JointReference

# what the source and the robot may do beyond the table

BAD_REFERENCES = {
    "none": None,
    "text": "no reference at all",
    "nan": JointReference(9, 0.0, np.full(N, np.nan), np.zeros(N)),
    "infinite speed": JointReference(9, 0.0, START, np.full(N, np.inf)),
    "too few joints": JointReference(9, 0.0, np.zeros(N - 1), np.zeros(N - 1)),
    "inactive": JointReference(9, 0.0, START, np.zeros(N), active=False),
    "no number": JointReference(9, 0.0, np.array(["a"] * N), np.zeros(N)),  # type: ignore[arg-type]
    "no seq": JointReference(np.nan, 0.0, START, np.zeros(N)),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("name", first(2, BAD_REFERENCES))
def test_without_a_reference_the_robot_brakes_and_then_goes_on(wire: Wire, name: str) -> None:
    wire.run()
    bad = BAD_REFERENCES[name] if name != "text" else 7
    since, count = len(wire.answers), wire.session.counts["bad_reference"]
    wire.exchange(100, bad)
    assert wire.session.counts["bad_reference"] == count + 100
    assert not wire.answers[-1].qd_ref.any()
    assert wire.session.phase == Phase.RUNNING
    wire.exchange(600)
    assert np.allclose(wire.answers[-1].q_ref, wire.source.q, rtol=0, atol=1e-6)
    wire.check_steps(since - 1)


def test_a_robot_that_does_not_follow_is_stopped_and_not_pushed(wire: Wire) -> None:
    wire.run()
    stuck = wire.q.copy()
    since = len(wire.answers)
    for _ in range(400):
        wire.q = stuck.copy()
        wire.exchange()
    assert wire.session.phase == Phase.STOPPED
    assert "rad from what it was sent" in wire.session.causes[0]
    assert np.allclose(wire.answers[-1].q_ref, stuck, atol=1e-9)  # slowly back to where it is held
    assert not wire.answers[-1].qd_ref.any()
    wire.check_steps(since - 1)
    worst = max(cycle.deviation.max() for cycle in wire.cycles if cycle.phase == Phase.RUNNING)
    assert worst <= SessionRules().deviation


def test_what_was_sent_before_a_new_start_is_no_excuse(wire: Wire) -> None:
    wire.run()
    wire.seq, wire.q = -1, np.full(N, 1.5)
    wire.exchange(2)
    wire.q = np.full(N, 1.3)  # towards where it was
    wire.exchange()
    assert wire.session.phase == Phase.STOPPING


def test_a_robot_that_ran_on_while_packets_were_missing_is_no_deviation(wire: Wire) -> None:
    wire.run()
    wire.exchange(50, None)
    q, speed = wire.answers[-1].q_ref, np.zeros(N)
    for k in range(40):
        speed = np.array([0.0, 0.0, 0.07 * (k + 1)])
        q = q - speed * DT
        wire.exchange(1, JointReference(k, 0.0, q, -speed))
    for missed, phase in ((20, Phase.RUNNING), (60, Phase.STOPPING)):  # within the lag, and far beyond
        wire.q = wire.session.q + wire.session.qd * missed * DT
        assert np.abs(wire.q - wire.session.q).max() > 2 * SessionRules().deviation
        wire.pass_time(missed + 1)
        wire.offer(wire.packet())
        q = q - speed * DT
        wire.answer(JointReference(0, 0.0, q, -speed))
        assert wire.session.phase == phase


def test_an_acknowledgement_waits_until_the_robot_stands(wire: Wire) -> None:
    """Acknowledged while the reference still gives way to a robot that is held: no jump, but a new start after that."""
    wire.run()
    stuck = wire.q.copy()
    since, count = len(wire.answers), 0
    for _ in range(400):
        wire.q = stuck.copy()
        wire.exchange(1, None if count else "source")
        if wire.session.phase == Phase.STOPPED and wire.answers[-1].qd_ref.any() and wire.session.acknowledge():
            count += 1
            assert wire.session.causes == ()
        if wire.cycles[-1].seeded:
            break
    assert count > 0
    assert wire.session.phase == Phase.RAMPING
    assert not wire.answers[-2].qd_ref.any()
    wire.check_steps(since - 1)


@given(st.integers(0, N - 1), st.integers(0, 40), st.floats(0.0, 0.9))
@settings(max_examples=some(2, of=6), deadline=None)
def test_a_robot_that_is_held_is_one_cause_until_acknowledged(joint: int, later: int, share: float) -> None:
    """Whatever else falls behind meanwhile, and however far."""
    wire = Wire().run()
    for k in range(500):
        stuck = wire.q.copy()
        wire.exchange()
        moved = wire.q - stuck
        moved[joint] *= share
        wire.q = stuck + (moved if k < later else 0.0)
        if wire.session.phase == Phase.STOPPED:
            break
    assert wire.session.phase == Phase.STOPPED
    assert len(wire.session.causes) == 1


def test_a_stop_after_an_acknowledgement_holds(wire: Wire) -> None:
    wire.run()
    wire.session.stop("one")
    wire.exchange(300)
    assert wire.session.acknowledge()
    wire.session.stop("two")
    wire.exchange(10)
    assert (wire.session.phase, wire.session.causes) == (Phase.STOPPED, ("two",))


def test_a_robot_that_lags_as_robots_do_is_no_deviation(wire: Wire) -> None:
    """20 ms behind, at the speed limit: far from the last reference, near to one that was sent lately."""
    session = wire.session
    wire.exchange(200)
    wire.source = Source(wire.q)
    sent = [wire.q.copy()] * 6
    for k in range(150):
        qd = np.minimum(A_MAX * DT * (k + 1), V_MAX) * (1 if k < 75 else 0.0)
        if k >= 75:
            qd = np.maximum(V_MAX - A_MAX * DT * (k - 74), 0.0)
        wire.pass_time()
        wire.q = sent[-5]
        assert wire.offer(wire.packet())
        cycle = session.take()
        assert cycle.deviation.max() < 0.02
        wire.source.q = wire.source.q + qd * DT
        answer = messages.decode_sensor(session.answer(JointReference(1000 + k, 0.0, wire.source.q, qd)), N)
        sent.append(answer.q_ref)
    assert session.phase == Phase.RUNNING
