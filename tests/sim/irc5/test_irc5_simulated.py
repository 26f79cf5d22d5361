"""The simulated IRC5: motion law, limits, time limits and states; and the wire that spoils datagrams on purpose."""

from __future__ import annotations

import math

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.messages import SensorPacket, encode_sensor
from qpsafe.sim.irc5.controller import IdealBody, SimulatedIrc5
from qpsafe.sim.irc5.link import Wire, WireFaults
from qpsafe.sim.irc5.motion import EgmSettings, MotionLaw

DT = 0.004
HOME = np.array([0.1, -0.2, 0.3, 0.0, 1.0, -0.5])
STILL = np.zeros(6)


def answer(q: np.ndarray, qd: np.ndarray = STILL, seq: int = 0) -> bytes:
    return encode_sensor(SensorPacket(seq, 0, q, qd))


def robot(**changes: float) -> SimulatedIrc5:
    return SimulatedIrc5(IdealBody(HOME, lag=0.0), EgmSettings(**changes))


def cycle(irc5: SimulatedIrc5, *answers: bytes):
    """One cycle of a real controller; what it sends."""
    irc5.advance()
    irc5.receive(answers)
    return irc5.packet()


@given(st.floats(0.1, 20.0), st.floats(-0.3, 0.3))  # below the cap on speed
@settings(max_examples=some(12, of=30))
def test_without_speed_and_low_pass_the_error_decays_by_the_gain(gain: float, step: float) -> None:
    law = MotionLaw(EgmSettings(gain=gain, lowpass=0.0), DT, HOME)
    law.refer(HOME + step, STILL)
    for _ in range(200):
        law.step()
    assert np.allclose(HOME + step - law.q, step * (1.0 - gain * DT) ** 200, atol=1e-12)


def test_a_position_with_its_speed_is_followed_without_lag() -> None:
    """pos_ref alone would be trailed by speed / k; what the low pass costs at the start, k makes good."""
    for paired, error in ((True, 0.0), (False, 0.2 / 5.0)):
        law = MotionLaw(EgmSettings(), DT, HOME)
        for k in range(2000):
            law.refer(HOME + 0.2 * DT * k, np.full(6, 0.2 * paired))
            law.step()
        assert np.allclose(HOME + 0.2 * DT * 2000 - law.q, error, atol=1e-9)


@given(st.floats(-1.0, 1.0), st.integers(1, 400))
@settings(max_examples=some(12, of=30))
def test_a_lost_answer_lets_the_robot_run_on_to_a_bound(speed: float, cycles: int) -> None:
    """To pos_ref + speed_ref / k at most, plus what the low pass still holds."""
    law = MotionLaw(EgmSettings(), DT, HOME)
    law.refer(HOME, np.full(6, speed))
    for _ in range(cycles):
        law.step()
    bound = abs(speed) / 5.0 + 1e-9
    assert (np.abs(law.q - HOME) <= bound).all()


def test_the_default_of_rapid_hardly_moves() -> None:
    slow = robot(max_speed_deviation=math.radians(1.0))
    for _ in range(250):
        cycle(slow, answer(HOME + 1.0))
    assert np.abs(slow.body.q - HOME).max() <= math.radians(1.0) + 1e-9
    assert slow.counts.limited > 200


def test_answers_are_used_once_in_the_cycle_after_they_came() -> None:
    irc5 = robot(lowpass=0.0)
    for _ in range(20):
        assert cycle(irc5, answer(HOME)).mci in ("stopped", "running")
    assert irc5.packet().mci == "running"
    irc5.receive([answer(HOME + 0.1)])
    before = irc5.law.q.copy()
    irc5.advance()
    assert np.allclose(irc5.law.q - before, 5.0 * 0.1 * DT)


def test_no_answer_for_comm_timeout_ends_the_run_and_rapid_starts_anew() -> None:
    irc5 = robot(comm_timeout=0.1, retry=0.2)
    for _ in range(20):
        cycle(irc5, answer(HOME, np.full(6, 0.1)))
    silent = 0
    while irc5.counts.timeouts == 0:
        packet = cycle(irc5)
        silent += 1
    assert silent == 25
    assert packet is None
    assert irc5.counts.missed == 25
    waited = 0
    while (packet := cycle(irc5)) is None:
        waited += 1
    assert waited == pytest.approx(0.2 / DT, abs=2)
    assert packet.seq == 0
    assert (irc5.law.qd == 0.0).all()


def test_without_a_retry_the_program_ends() -> None:
    irc5 = robot(comm_timeout=0.02, retry=math.inf)
    cycle(irc5, answer(HOME))
    sent = [cycle(irc5) for _ in range(2000)]
    assert irc5.counts.timeouts == 1
    assert sent[-1] is None
    assert not irc5.rapid
    assert irc5.mci == "error"


def test_egm_run_joint_returns_once_converged_and_is_run_anew() -> None:
    irc5 = robot(cond_time=0.2)
    states = [cycle(irc5, answer(HOME)).mci for _ in range(200)]
    assert irc5.counts.returns >= 2
    assert {"stopped", "running"} == set(states)
    never = robot()
    for _ in range(1000):
        cycle(never, answer(HOME))
    assert never.counts.returns == 0


def test_with_the_motors_off_it_stands_and_then_resumes_in_the_same_state() -> None:
    irc5 = robot(lowpass=0.0)
    for _ in range(20):
        cycle(irc5, answer(HOME))
    irc5.motors(False)
    here = irc5.body.q.copy()
    for _ in range(50):
        packet = cycle(irc5, answer(HOME + 0.1))
        assert (packet.motors_on, packet.rapid, packet.mci) == (False, "stopped", "stopped")
    assert (irc5.body.q == here).all()
    irc5.motors(True)
    assert cycle(irc5).mci == "running"
    cycle(irc5)
    assert np.allclose(irc5.law.q - here, 0.5 * DT)  # the correction that came meanwhile acts at once: hence the gate
    irc5.program(False)
    assert cycle(irc5).rapid == "stopped"


def test_a_restart_counts_from_zero_and_the_sequence_wraps() -> None:
    irc5 = robot()
    irc5.seq = 2**32 - 1
    assert [irc5.packet().seq for _ in range(3)] == [2**32 - 1, 0, 1]
    irc5.restart(pause=0.1)
    assert irc5.packet() is None
    for _ in range(26):
        packet = cycle(irc5)
    assert packet.seq <= 1
    assert packet.mci == "stopped"


@given(st.lists(st.binary(max_size=60), max_size=5))
def test_junk_moves_nothing(junk: list[bytes]) -> None:
    irc5 = robot()
    cycle(irc5, answer(HOME))
    before = irc5.law.q.copy()
    for _ in range(5):
        cycle(irc5, *junk)
    assert (irc5.law.q == before).all()
    assert irc5.counts.rejected + irc5.counts.extra + irc5.counts.answered >= 5 * len(junk)


def test_an_ideal_body_is_late_by_the_lag() -> None:
    body = IdealBody(STILL, lag=0.012)
    for k in range(10):
        body.apply(np.full(6, DT * k), np.full(6, 1.0))
        body.advance()
        assert np.allclose(body.q, max(DT * (k + 1 - 3), 0.0))


# the wire


def test_a_good_wire_changes_nothing() -> None:
    wire = Wire(WireFaults(), np.random.default_rng(0))
    for k in range(10):
        wire.put(bytes([k]))
        assert wire.take() == [bytes([k])]
    assert wire.take() == []


@given(
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.02),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=some(8, of=50))
def test_what_goes_in_comes_out_or_is_counted(
    loss: float, delay: float, reorder: float, duplicate: float, seed: int
) -> None:
    wire = Wire(WireFaults(loss, delay, reorder, duplicate), np.random.default_rng(seed))
    came = []
    for k in range(60):
        wire.put(k.to_bytes(2, "big"))
        came += wire.take()
    for _ in range(10):
        came += wire.take()
    assert len(came) == 60 - wire.lost + wire.duplicated
    assert len(set(came)) == 60 - wire.lost


def test_delay_loss_and_order() -> None:
    late = Wire(WireFaults(delay=0.012), np.random.default_rng(0))
    late.put(b"a")
    assert [late.take() for _ in range(4)] == [[], [], [], [b"a"]]
    lost = Wire(WireFaults(loss=1.0), np.random.default_rng(0))
    lost.put(b"a")
    assert lost.take() == []
    swapped = Wire(WireFaults(reorder=1.0), np.random.default_rng(0))
    swapped.put(b"a")
    assert swapped.take() == []
    swapped.faults = WireFaults()
    swapped.put(b"b")
    assert swapped.take() == [b"b", b"a"]
    twice = Wire(WireFaults(duplicate=1.0), np.random.default_rng(0))
    twice.put(b"a")
    assert twice.take() + twice.take() == [b"a", b"a"]
    spoilt = Wire(WireFaults(garbage=1.0), np.random.default_rng(0))
    spoilt.put(b"good")
    found = spoilt.take()
    assert found[0] == b"good"
    assert len(found) == 2
    assert found[1] != b"good"


@pytest.mark.parametrize("wrong", [{"loss": 1.5}, {"delay": -1.0}, {"garbage": math.nan}])
def test_wrong_faults_are_named(wrong: dict) -> None:
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        WireFaults(**wrong)


@pytest.mark.parametrize("wrong", [{"gain": 21.0}, {"lowpass": -1.0}, {"comm_timeout": 0.0}, {"cond_time": math.nan}])
def test_wrong_settings_are_named(wrong: dict) -> None:
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        EgmSettings(**wrong)
