"""A seventh axis and external joints go through EGM's `externalJoints` both ways, in the controller's order."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.irc5 import messages
from qpsafe.irc5 import qpsafe_egm_pb2 as wire
from qpsafe.irc5.messages import MalformedPacket, RobotPacket, SensorPacket
from qpsafe.irc5.session import EgmSession
from qpsafe.irc5.transport.axes import Axes, axes_of, axes_of_robot
from qpsafe.limits import JointLimits
from qpsafe.robot.loader import bundled_robots
from qpsafe.sim.irc5.controller import IdealBody, SimulatedIrc5


@st.composite
def axes(draw: st.DrawFn) -> Axes:
    """Any robot of up to 14 joints, any of them external, any of them sliding."""
    n = draw(st.integers(1, 14))
    places = draw(st.permutations(range(n)))
    external = places[: draw(st.integers(max(0, n - 6), n))]
    return Axes(n, external, draw(st.lists(st.integers(0, n - 1), unique=True)))


def joints(n: int) -> st.SearchStrategy[np.ndarray]:
    return st.lists(st.floats(-1e3, 1e3), min_size=n, max_size=n).map(np.array)


def on_the_wire(part: object, axes: Axes) -> list[float]:
    """What a controller reads, as values of the robot's joints: an own reading of the two lists."""
    inner, outer = iter(part.joints.joints), list(part.externalJoints.joints)  # type: ignore[attr-defined]
    places = [int(k) for k in axes.outer]
    return [outer[places.index(k)] if k in places else next(inner) for k in range(axes.n)]


@given(st.data(), axes())
@settings(max_examples=some(10, of=60))
def test_both_messages_are_read_back_and_say_degrees_and_mm(data: st.DataObject, axes: Axes) -> None:
    q, qd = data.draw(joints(axes.n)), data.draw(joints(axes.n))
    said = messages.encode_robot(RobotPacket(1, 4, q, qd, clock=1.0), axes)
    found = messages.decode_robot(said, axes)
    assert found.q_planned is not None
    assert np.allclose(found.q, q, rtol=1e-15, atol=1e-300)
    assert np.allclose(found.q_planned, qd, rtol=1e-15, atol=1e-300)
    answer = messages.encode_sensor(SensorPacket(1, 4, q, qd), axes)
    heard = messages.decode_sensor(answer, axes)
    assert np.allclose(heard.q_ref, q, rtol=1e-15, atol=1e-300)
    assert np.allclose(heard.qd_ref, qd, rtol=1e-15, atol=1e-300)
    unit = [1000.0 if k in axes.linear else 180.0 / math.pi for k in range(axes.n)]
    for message, expected in (
        (wire.EgmRobot.FromString(said).feedBack, q),
        (wire.EgmRobot.FromString(said).planned, qd),
        (wire.EgmSensor.FromString(answer).planned, q),
        (wire.EgmSensor.FromString(answer).speedRef, qd),
    ):
        assert len(message.joints.joints) <= 6
        assert np.allclose(on_the_wire(message, axes), expected * unit, rtol=1e-14, atol=1e-300)


@given(axes(), st.integers(0, 7), st.integers(0, 14))
@settings(max_examples=some(10, of=60))
def test_another_number_of_either_kind_is_refused(axes: Axes, inner: int, outer: int) -> None:
    message = wire.EgmRobot.FromString(messages.encode_robot(RobotPacket(1, 4, np.zeros(axes.n), clock=1.0), axes))
    message.feedBack.joints.joints[:] = [1.0] * inner
    message.feedBack.externalJoints.joints[:] = [1.0] * outer
    if (inner, outer) == (len(axes.inner), len(axes.outer)):
        assert len(messages.decode_robot(message.SerializeToString(), axes).q) == axes.n
        return
    with pytest.raises(MalformedPacket, match="expected") as caught:
        messages.decode_robot(message.SerializeToString(), axes)
    assert caught.value.reason == messages.WRONG_JOINT_COUNT


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_external_values_that_are_not_finite_are_refused_and_never_sent(bad: float) -> None:
    q = np.zeros(7)
    q[6] = bad
    with pytest.raises(MalformedPacket) as caught:
        messages.decode_robot(messages.encode_robot(RobotPacket(1, 4, q, clock=1.0)), 7)
    assert caught.value.reason == messages.NOT_FINITE
    with pytest.raises(ValueError, match="no reference"):
        messages.encode_sensor(SensorPacket(1, 4, q, np.zeros(7)))


@pytest.mark.parametrize("n", range(1, 15))
def test_by_default_the_first_six_are_the_robots(n: int) -> None:
    assert axes_of(n).inner.tolist() == list(range(min(n, 6)))
    assert axes_of(n).outer.tolist() == list(range(6, n))


@pytest.mark.parametrize("external", [[], [7], [-1], [0, 0], [1.5]])
def test_wrong_axes_are_named(external: list) -> None:
    with pytest.raises(ConfigurationError, match="external"):
        Axes(7, external)
    with pytest.raises(ConfigurationError, match="axes"):
        EgmSession(JointLimits(*np.array([[-1.0] * 7, [1.0] * 7, [1.0] * 7, [9.0] * 7]), 0.004), axes=Axes(6))


@pytest.mark.parametrize("peer", ["ABBRobotEGM._egm_protobuf", "abb_robot_client._egm_protobuf"])
def test_others_read_what_we_send(peer: str) -> None:
    """Their message modules, in a process of its own."""
    seven = Axes(7, [2])
    q = np.deg2rad(np.arange(1.0, 8.0))
    sent = messages.encode_sensor(SensorPacket(1, 4, q, 2.0 * q), seven)
    code = (
        f"import json, sys; from {peer} import egm_pb2 as wire\n"
        f"m = wire.EgmSensor.FromString(bytes.fromhex({sent.hex()!r}))\n"
        "parts = m.planned.joints, m.planned.externalJoints, m.speedRef.joints, m.speedRef.externalJoints\n"
        "print(json.dumps([list(part.joints) for part in parts]))\n"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, timeout=120, capture_output=True, text=True)
    inner, outer, speeds, outer_speeds = json.loads(run.stdout)
    assert np.allclose(inner, [1, 2, 4, 5, 6, 7])
    assert np.allclose(outer, [3])
    assert np.allclose(speeds, [2, 4, 8, 10, 12, 14])
    assert np.allclose(outer_speeds, [6])


@pytest.mark.parametrize("name", first(2, sorted(bundled_robots(), key="irb14000".__ne__)))
def test_every_bundled_robot_is_driven_by_a_session_in_lock_step(name: str) -> None:
    """Bytes both ways: ramped in and moved, external joints too."""
    robot = qpsafe.load_robot(name)
    limits = JointLimits(robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, 0.004)
    axes = axes_of_robot(robot)
    session, irc5 = EgmSession(limits, axes=axes), SimulatedIrc5(IdealBody(robot.home, lag=0.0), axes=axes)
    source = robot.home.copy()
    speed = np.minimum(0.2, 0.2 * robot.max_velocity)
    for k in range(400):
        packet = irc5.packet()
        assert packet is not None
        assert session.offer(messages.encode_robot(packet, axes), ("127.0.0.1", 1), 0.004 * k)
        cycle = session.take()
        assert cycle is not None
        reference = None
        if cycle.moving:
            source = source + speed * 0.004 * (k < 300)
            reference = qpsafe.JointReference(k, 0.0, source, speed * (k < 300))
        data = session.answer(reference)
        assert data is not None
        irc5.receive([data])
        irc5.advance()
    assert (irc5.counts.rejected, session.counts["accepted"]) == (0, 400)
    assert (np.abs(irc5.body.q - robot.home) > 0.1 * speed).all()
    assert np.allclose(irc5.body.q, source, atol=1e-3)


def test_the_robot_file_says_which_joints_are_external(tmp_path: Path) -> None:
    robot = qpsafe.load_robot("iiwa14")
    assert robot.external_joints is None
    folder = tmp_path / "seven"
    shutil.copytree(robot.folder, folder)
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    third = robot.joint_names[2]
    (folder / "robot.toml").write_text(text + f'\n[egm]\nexternal = ["{third}"]\n', encoding="utf-8")
    own = axes_of_robot(qpsafe.load_robot(folder))
    assert own.outer.tolist() == [2]
    assert own.inner.tolist() == [0, 1, 3, 4, 5, 6]
    (folder / "robot.toml").write_text(text + '\n[egm]\nexternal = ["joint_77"]\n', encoding="utf-8")
    with pytest.raises(qpsafe.ConfigurationError, match=r"egm.external.*joint_77"):
        qpsafe.load_robot(folder)
