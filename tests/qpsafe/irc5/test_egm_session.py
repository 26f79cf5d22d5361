"""An EGM session without a socket: every row of the fault table, and what holds whatever happens."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.irc5 import messages
from qpsafe.irc5.messages import RobotPacket, SensorPacket
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.session import Cycle, EgmSession, Phase
from qpsafe.limits import JointLimits
from qpsafe.reference import JointReference

DT, N = 0.004, 3
V_MAX, A_MAX = np.array([3.0, 2.0, 5.0]), np.array([10.0, 8.0, 20.0])
LIMITS = JointLimits(np.full(N, -2.0), np.full(N, 2.0), V_MAX, A_MAX, DT)
START = np.array([0.3, -0.4, 0.5])
PEER = ("127.0.0.1", 5000)


class Source:
    """References that start at rest at a pose and then go back and forth, within the limits."""

    def __init__(self, q: np.ndarray) -> None:
        self.q, self.seq = q.copy(), 0

    def step(self) -> JointReference:
        qd = np.array([0.5, -0.4, 0.8]) * np.sin(2.0 * DT * self.seq)
        self.q = self.q + qd * DT
        self.seq += 1
        return JointReference(self.seq, self.seq * DT, self.q, qd)


@dataclass
class Wire:
    """A session, a robot that does as it is told, and everything that was said."""

    session: EgmSession = field(default_factory=lambda: EgmSession(LIMITS))
    q: np.ndarray = field(default_factory=START.copy)
    seq: int = 0
    time: float = 100.0
    clock: float = 5000.0
    states: dict[str, Any] = field(default_factory=dict)
    source: Source | None = None
    answers: list[SensorPacket] = field(default_factory=list)
    cycles: list[Cycle] = field(default_factory=list)

    def packet(self, **changes: Any) -> bytes:
        """The robot's next words, with changes."""
        values = {"seq": self.seq, "time_ms": 4 * self.seq, "q": self.q, "clock": self.clock, **self.states, **changes}
        return messages.encode_robot(RobotPacket(**values))

    def pass_time(self, ticks: int = 1) -> None:
        self.seq = (self.seq + ticks) % 2**32
        self.time += ticks * DT
        self.clock += ticks * DT

    def offer(self, data: bytes, sender: tuple[str, int] = PEER) -> bool:
        return self.session.offer(data, sender, self.time)

    def answer(self, reference: Any = "source") -> SensorPacket | None:
        """Take the cycle and answer it; the source starts anew when asked to."""
        cycle = self.session.take()
        if cycle is None:
            return None
        self.cycles.append(cycle)
        if cycle.seeded or self.source is None:
            self.source = Source(cycle.packet.q)
        if isinstance(reference, str):
            reference = self.source.step() if cycle.moving else None
        data = self.session.answer(reference)
        assert data is not None
        self.answers.append(messages.decode_sensor(data, N))
        return self.answers[-1]

    def exchange(self, ticks: int = 1, reference: Any = "source", **changes: Any) -> SensorPacket:
        """Whole cycles; the robot is where it was sent one tick ago."""
        for _ in range(ticks):
            self.pass_time()
            assert self.offer(self.packet(**changes))
            found = self.answer(reference)
            assert found is not None
            self.q = found.q_ref.copy()
        return found

    def run(self) -> Wire:
        """Until the source drives the robot."""
        self.exchange(200)
        assert self.session.phase == Phase.RUNNING
        return self

    def check_steps(self, since: int = 0) -> None:
        """From answer to answer: position and speed go together, and neither jumps."""
        for last, now in zip(self.answers[since:], self.answers[since + 1 :], strict=False):
            assert np.allclose(now.q_ref, last.q_ref + now.qd_ref * DT, rtol=0, atol=1e-9)
            assert (np.abs(now.qd_ref) <= V_MAX * (1 + 1e-9)).all()
            assert (np.abs(now.qd_ref - last.qd_ref) <= A_MAX * DT * (1 + 1e-9)).all()


@pytest.fixture
def wire() -> Wire:
    return Wire()


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


# row: motors off, E-stop, RAPID stopped -> hold the measured q; gate on motors, mci and RAPID state

CLOSED = [{"motors_on": False}, *({"mci": mci} for mci in messages.MCI_STATES[:3])]
CLOSED += [{"rapid": rapid} for rapid in messages.RAPID_STATES[:2]]


@pytest.mark.parametrize("states", CLOSED, ids=str)
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


# row: NaN, wrong joint count, wrong sender, garbage -> reject, count, never raise; pin the peer's address

JUNK = {
    "garbage": lambda wire: b"\xff\x00junk",
    "wrong_kind": lambda wire: messages.encode_sensor(SensorPacket(wire.seq, 0, wire.q, wire.q)),
    "incomplete": lambda wire: b"\x12\x00",
    "wrong_joint_count": lambda wire: wire.packet(q=np.zeros(N + 1)),
    "not_finite": lambda wire: wire.packet(q=np.full(N, np.nan)),
    "no_clock": lambda wire: wire.packet(clock=None),
    "implausible": lambda wire: wire.packet(q=np.full(N, np.deg2rad(1e6))),
}


@pytest.mark.parametrize("reason", JUNK)
def test_junk_is_refused_counted_and_changes_nothing(wire: Wire, reason: str) -> None:
    for _ in range(2):  # before the robot is known, and later
        wire.pass_time()
        before = (wire.session.phase, wire.session.sender, wire.session.q.copy(), wire.session.qd.copy())
        counts = wire.session.counts[reason]
        assert not wire.offer(JUNK[reason](wire))
        assert wire.answer() is None
        after = (wire.session.phase, wire.session.sender, wire.session.q, wire.session.qd)
        assert before[:2] == after[:2]
        assert np.array_equal(before[2:], after[2:])
        assert wire.session.counts[reason] == counts + 1
        assert wire.session.inbox.refusal
        wire.run()
    wire.check_steps(200)


@pytest.mark.parametrize("q", [1e306, -1e306, 2e4])
def test_joints_without_limits_do_not_turn_any_distance_either(q: float) -> None:
    endless = JointLimits(np.full(N, -np.inf), np.full(N, np.inf), V_MAX, A_MAX, DT)
    wire = Wire(EgmSession(endless))
    wire.pass_time()
    assert not wire.offer(wire.packet(q=np.full(N, q)))
    assert wire.session.counts["implausible"] == 1
    wire.run()


def test_mixed_units_are_refused_by_name(wire: Wire) -> None:
    """Row: RobotWare < 6.07 -> refuse when feedBack.time is missing."""
    assert not wire.offer(wire.packet(clock=None))
    assert "RobotWare before 6.07" in wire.session.inbox.refusal
    assert wire.session.phase == Phase.WAITING


@pytest.mark.parametrize("sender", [("127.0.0.2", 5000), ("127.0.0.1", 5001)])
def test_the_peer_is_pinned_by_its_first_valid_packet(wire: Wire, sender: tuple[str, int]) -> None:
    assert not wire.offer(b"junk", sender)  # pins nobody
    wire.run()
    wire.pass_time()
    assert not wire.offer(wire.packet(), sender)
    assert wire.session.counts["wrong_sender"] == 1
    assert wire.session.sender == PEER


def test_a_named_peer_is_the_only_one() -> None:
    wire = Wire(EgmSession(LIMITS, peer="192.168.125.1"))
    wire.pass_time()
    assert not wire.offer(wire.packet())
    assert wire.offer(wire.packet(), ("192.168.125.1", 4711))


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


@pytest.mark.parametrize("name", BAD_REFERENCES)
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
@settings(max_examples=6, deadline=None)
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


# whatever happens

EVENTS = st.sampled_from(
    ["good"] * 8
    + ["lost", "duplicate", "stale", "restart", "silence", "motors off", "mci error", "rapid stopped", "junk", "moved"]
    + [
        "wrong sender",
        "no reference",
        "nan reference",
        "jumping reference",
        "fast reference",
        "stop",
        "acknowledge",
        "twice",
    ]
)


@settings(max_examples=60, deadline=None)
@given(events=st.lists(st.tuples(EVENTS, st.integers(1, 60)), max_size=40), data=st.data())
def test_whatever_happens_answers_are_finite_unique_and_never_jump(events: list, data: st.DataObject) -> None:
    wire = Wire(EgmSession(LIMITS, SessionRules(ramp_in=0.05, ramp_out=0.02)))
    junk = data.draw(st.binary(max_size=40))
    last: SensorPacket | None = None
    for event, times in events:
        for _ in range(times):
            wire.pass_time()
            if event == "lost":
                continue
            if event == "restart":
                wire.seq = 0
            if event == "silence":
                wire.pass_time(300)
            if event == "moved":
                wire.q = wire.q + 0.01
            if event == "stop":
                wire.session.stop("asked")
            if event == "acknowledge":
                wire.session.acknowledge()
            if event == "junk":
                assert not wire.offer(junk)
            if event == "wrong sender":
                wire.offer(wire.packet(), ("10.0.0.1", 1))
            if event == "stale":
                wire.offer(wire.packet(seq=(wire.seq - 5) % 2**32, clock=wire.clock - 5 * DT))
            changes = {"motors off": {"motors_on": False}, "mci error": {"mci": "error"}}.get(event, {})
            changes = {"rapid": "stopped"} if event == "rapid stopped" else changes
            measured = wire.q.copy()
            wire.offer(wire.packet(**changes))
            if event in ("duplicate", "twice"):
                wire.offer(wire.packet(**changes))
            q = wire.source.q if wire.source else wire.q
            odd = {
                "no reference": None,
                "nan reference": JointReference(1, 0.0, np.full(N, np.nan), np.zeros(N)),
                "jumping reference": JointReference(1, 0.0, -3.0 * q, np.zeros(N)),
                "fast reference": JointReference(1, 0.0, q, np.full(N, 99.0)),
            }
            answer = wire.answer(odd.get(event, "source"))
            if event == "twice":
                assert wire.answer() is None
            if answer is None:
                continue
            assert np.isfinite(answer.q_ref).all()
            if wire.cycles[-1].seeded and not wire.cycles[-1].moving:
                assert np.allclose(answer.q_ref, measured, rtol=1e-9, atol=1e-9)
                assert not answer.qd_ref.any()
            else:
                before = SensorPacket(0, 0, measured, np.zeros(N)) if wire.cycles[-1].seeded else last
                assert before is not None
                wire.answers[-2:] = [before, answer]
                wire.check_steps(len(wire.answers) - 2)
            last = answer
            wire.q = answer.q_ref.copy()
    counts = wire.session.counts
    assert counts["answered"] + counts["superseded"] == counts["accepted"]


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"limits": "robot"}, "limits"),
        ({"limits": LIMITS, "joint_names": ["one"]}, "joint_names"),
    ],
)
def test_a_wrong_session_is_refused_by_name(arguments: dict, key: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        EgmSession(**arguments)
    assert caught.value.key == key


@pytest.mark.parametrize("name", SessionRules.__dataclass_fields__)
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, None, True, "1"])
def test_wrong_rules_are_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(ConfigurationError) as caught:
        SessionRules(**{name: value})
    assert caught.value.key == name
