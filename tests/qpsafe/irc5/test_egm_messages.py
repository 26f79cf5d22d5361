"""EGM messages: round trips, what is refused and why, and the generated module against its .proto."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from amounts import first
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.irc5 import messages
from qpsafe.irc5 import qpsafe_egm_pb2 as wire
from qpsafe.irc5.messages import MalformedPacket, RobotPacket, SensorPacket

ROOT = Path(__file__).resolve().parents[3]
N = 6
COUNTERS = st.integers(0, 2**32 - 1)
JOINTS = st.lists(st.floats(-1e3, 1e3), min_size=N, max_size=N).map(np.array)
CLOCKS = st.none() | st.integers(0, 4 * 10**15).map(lambda micros: micros / 1e6)
ROBOTS = st.builds(
    RobotPacket,
    seq=COUNTERS,
    time_ms=COUNTERS,
    q=JOINTS,
    q_planned=st.none() | JOINTS,
    motors_on=st.booleans(),
    mci=st.sampled_from(messages.MCI_STATES),
    rapid=st.sampled_from(messages.RAPID_STATES),
    converged=st.booleans(),
    clock=CLOCKS,
)


def same(a: np.ndarray | None, b: np.ndarray | None) -> bool:
    """Equal up to the rounding of rad -> deg -> rad."""
    return (a is None and b is None) or np.allclose(a, b, rtol=4e-16, atol=1e-300)


@given(ROBOTS)
def test_what_a_robot_says_is_read_back(packet: RobotPacket) -> None:
    found = messages.decode_robot(messages.encode_robot(packet), N)
    for name in ("seq", "time_ms", "motors_on", "mci", "rapid", "converged", "clock"):
        assert getattr(found, name) == getattr(packet, name)
    assert same(found.q, packet.q)
    assert same(found.q_planned, packet.q_planned)


@given(COUNTERS, COUNTERS, JOINTS, JOINTS)
def test_what_we_answer_is_read_back(seq: int, time_ms: int, q: np.ndarray, qd: np.ndarray) -> None:
    found = messages.decode_sensor(messages.encode_sensor(SensorPacket(seq, time_ms, q, qd)), N)
    assert (found.seq, found.time_ms) == (seq, time_ms)
    assert same(found.q_ref, q)
    assert same(found.qd_ref, qd)


def test_the_wire_has_degrees() -> None:
    data = messages.encode_sensor(SensorPacket(7, 8, np.full(N, np.pi / 2), np.full(N, -np.pi)))
    message = wire.EgmSensor.FromString(data)
    assert list(message.planned.joints.joints) == [90.0] * N
    assert list(message.speedRef.joints.joints) == [-180.0] * N
    assert (message.header.seqno, message.header.tm, message.header.mtype) == (7, 8, 3)


def a_robot() -> wire.EgmRobot:
    packet = RobotPacket(5, 20, np.arange(N) / 10.0, np.arange(N) / 10.0, converged=True, clock=1.5)
    return wire.EgmRobot.FromString(messages.encode_robot(packet))


def refused(message: wire.EgmRobot) -> str:
    with pytest.raises(MalformedPacket) as caught:
        messages.decode_robot(message.SerializeToString(), N)
    return caught.value.reason


@pytest.mark.parametrize("field", ["header", "feedBack"])
def test_what_must_be_there_is_asked_for(field: str) -> None:
    message = a_robot()
    message.ClearField(field)
    assert refused(message) == {"header": messages.INCOMPLETE, "feedBack": messages.WRONG_JOINT_COUNT}[field]


@pytest.mark.parametrize("field", ["seqno", "mtype"])
def test_a_header_must_be_whole(field: str) -> None:
    message = a_robot()
    message.header.ClearField(field)
    assert refused(message) == messages.INCOMPLETE


def test_a_header_may_lack_its_time() -> None:
    """Known senders leave it out."""
    message = a_robot()
    message.header.ClearField("tm")
    assert messages.decode_robot(message.SerializeToString(), N).time_ms == 0


@pytest.mark.parametrize("kind", [0, 1, 3, 4])
def test_other_kinds_of_messages_are_refused(kind: int) -> None:
    message = a_robot()
    message.header.mtype = kind
    assert refused(message) == messages.WRONG_KIND


@pytest.mark.parametrize("count", [0, 5, 7, 400])
@pytest.mark.parametrize("where", ["feedBack", "planned"])
def test_a_wrong_number_of_joints_is_refused(where: str, count: int) -> None:
    message = a_robot()
    joints = getattr(message, where).joints.joints
    del joints[:]
    joints.extend([1.0] * count)
    if (where, count) == ("planned", 0):  # as good as no plan
        assert messages.decode_robot(message.SerializeToString(), N).q_planned is None
    else:
        assert refused(message) == messages.WRONG_JOINT_COUNT


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["feedBack", "planned"])
def test_values_that_are_not_finite_are_refused(where: str, bad: float) -> None:
    message = a_robot()
    getattr(message, where).joints.joints[3] = bad
    assert refused(message) == messages.NOT_FINITE


@pytest.mark.parametrize("data", [b"", b"\x00", b"\xff" * 40, b"hello robot", b"\x0a" * 5000])
def test_garbage_is_refused(data: bytes) -> None:
    for decode in (messages.decode_robot, messages.decode_sensor):
        with pytest.raises(MalformedPacket) as caught:
            decode(data, N)
        assert caught.value.reason == messages.GARBAGE


def test_without_states_the_safe_ones_are_assumed() -> None:
    message = a_robot()
    for field in ("motorState", "mciState", "rapidExecState", "mciConvergenceMet", "planned"):
        message.ClearField(field)
    packet = messages.decode_robot(message.SerializeToString(), N)
    assert (packet.motors_on, packet.mci, packet.rapid) == (False, "undefined", "undefined")
    assert not packet.converged


def test_states_unknown_to_us_are_undefined() -> None:
    """Field 5 (mciState) with state 9, field 8 (rapidExecState) with state 77: proto2 keeps them aside."""
    message = a_robot()
    message.ClearField("mciState")
    message.ClearField("rapidExecState")
    data = message.SerializeToString() + b"\x2a\x02\x08\x09" + b"\x42\x02\x08\x4d"
    packet = messages.decode_robot(data, N)
    assert (packet.mci, packet.rapid) == ("undefined", "undefined")


@pytest.mark.parametrize("field", ["sec", "usec"])
def test_half_a_clock_is_none(field: str) -> None:
    message = a_robot()
    message.feedBack.time.ClearField(field)
    assert messages.decode_robot(message.SerializeToString(), N).clock is None


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("which", ["q_ref", "qd_ref"])
def test_no_robot_is_sent_what_is_not_finite(which: str, bad: float) -> None:
    good = {"q_ref": np.zeros(N), "qd_ref": np.zeros(N)}
    good[which][2] = bad
    with pytest.raises(ValueError, match="no reference for a robot"):
        messages.encode_sensor(SensorPacket(0, 0, **good))
    with pytest.raises(ValueError, match="no reference for a robot"):
        messages.encode_sensor(SensorPacket(0, 0, np.zeros(N), np.zeros(N - 1)))


@given(COUNTERS, COUNTERS)
def test_newer_is_an_order_modulo_the_wrap(a: int, b: int) -> None:
    if a == b or (a - b) % 2**32 == 2**31:
        assert not (messages.newer(a, b) and messages.newer(b, a))
    else:
        assert messages.newer(a, b) != messages.newer(b, a)
    assert messages.newer((a + 1) % 2**32, a)
    assert not messages.newer(a, a)


def test_the_generated_module_is_that_of_the_proto() -> None:
    """Every field with its number and type, as the text of the .proto has them."""
    text = re.sub(r"//.*", "", (ROOT / "qpsafe/irc5/qpsafe_egm.proto").read_text(encoding="utf-8"))
    assert re.search(r"^package (.*);", text, re.MULTILINE)[1] == wire.DESCRIPTOR.package  # type: ignore[index]
    written: dict[str, set] = {}
    for name, body in re.findall(r"^message (\w+) \{\n(.*?)^\}", text, re.MULTILINE | re.DOTALL):
        rows = re.findall(r"(optional|repeated) (\w+) (\w+) = (\d+);", body)
        values = re.findall(r"^\s+([A-Z_]+) = (\d+);", body, re.MULTILINE)
        written[name] = {(rule, kind, field, int(number)) for rule, kind, field, number in rows}
        written[name] |= {(value, int(number)) for value, number in values}
    kinds = {1: "double", 4: "uint64", 8: "bool", 13: "uint32"}
    built: dict[str, set] = {}
    for name, message in wire.DESCRIPTOR.message_types_by_name.items():
        built[name] = {(v.name, v.number) for enum in message.enum_types for v in enum.values}
        for field in message.fields:
            named = field.message_type or field.enum_type
            kind = named.name if named else kinds[field.type]
            repeated = hasattr(getattr(message._concrete_class(), field.name), "extend")
            built[name].add(("repeated" if repeated else "optional", kind, field.name, field.number))
    assert built == written


@pytest.mark.parametrize("peer", first(1, ["ABBRobotEGM", "abb_robot_client.egm"]))
def test_our_messages_load_beside_those_of_others(peer: str) -> None:
    """Own file name and package: nothing collides, whichever comes first."""
    for order in (f"{peer}, qpsafe.irc5.messages", f"qpsafe.irc5.messages, {peer}"):
        subprocess.run([sys.executable, "-c", f"import {order}"], check=True, timeout=60, capture_output=True)


@pytest.mark.slow
def test_only_irc5_needs_protobuf() -> None:
    code = "import sys, qpsafe, qpsafe.controller, qpsafe.reference; print('google.protobuf' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], check=True, timeout=120, capture_output=True, text=True)
    assert run.stdout.strip() == "False"
