"""What an EGM session refuses, by name, and counts: junk, strangers, mixed units, wrong rules."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import thinned
from egm_wire import A_MAX, DT, LIMITS, PEER, V_MAX, N, Wire

from qpsafe.errors import ConfigurationError
from qpsafe.irc5 import messages
from qpsafe.irc5.messages import SensorPacket
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.session import EgmSession, Phase
from qpsafe.limits import JointLimits

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


@pytest.mark.parametrize("reason", thinned(2, JUNK))
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
