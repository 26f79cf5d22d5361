"""EGM messages: SI units inside, degrees and mm on the wire; what arrives is checked, and refused with a reason."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError, QpsafeError
from qpsafe.extras import require
from qpsafe.irc5.transport.axes import Axes, axes_of
from qpsafe.text.given import number, numbers, one_of, whole
from qpsafe.text.words import counted

require("irc5", "EGM", "google.protobuf")
_wire: Any = import_module("qpsafe.irc5.qpsafe_egm_pb2")

#: EGM's port, unless the robot's configuration says otherwise.
DEFAULT_PORT = 6510

#: Sequence numbers and times [ms] count modulo this.
WRAP = 2**32

#: Longer datagrams are not read [byte]; the largest message of a robot, all fields filled, has about 1000.
MAX_SIZE = 4096

#: Reasons of `MalformedPacket`.
GARBAGE, WRONG_KIND, INCOMPLETE = "garbage", "wrong_kind", "incomplete"
WRONG_JOINT_COUNT, NOT_FINITE = "wrong_joint_count", "not_finite"
REASONS = (GARBAGE, WRONG_KIND, INCOMPLETE, WRONG_JOINT_COUNT, NOT_FINITE)

_CLOCK = "a time on the robot's clock, 0 to 2^63 [s], or None"

#: Words for the states of motion control (MCI) and of the RAPID program, by their number on the wire.
MCI_STATES = ("undefined", "error", "stopped", "running")
RAPID_STATES = ("undefined", "stopped", "running")


class MalformedPacket(QpsafeError, ValueError):
    """A datagram is not the message that was expected.

    Attributes:
        reason: One of `REASONS`.
    """

    def __init__(self, reason: str, message: str) -> None:
        self.reason = reason
        super().__init__(message)


@dataclass(frozen=True, slots=True, eq=False)
class RobotPacket:
    """What the robot says at every cycle (EgmRobot).

    Attributes:
        seq: Sequence number, counts modulo 2^32.
        time_ms: The controller's time [ms], modulo 2^32; 0 if it was left out.
        q: Measured joint positions (n,) [rad].
        q_planned: Joint positions that the controller plans (n,) [rad], or None.
        motors_on: Whether the motors are known to be on.
        mci: Motion control: ``undefined``, ``error``, ``stopped`` or ``running``.
        rapid: RAPID program: ``undefined``, ``stopped`` or ``running``.
        converged: Whether EGM's convergence criteria are met.
        clock: When `q` was measured, by the controller's clock [s]; None from a RobotWare older than 6.07, whose joint
            values mix units: do not drive such a robot.
    """

    seq: int
    time_ms: int
    q: NDArray[np.float64]
    q_planned: NDArray[np.float64] | None = None
    motors_on: bool = True
    mci: str = "running"
    rapid: str = "running"
    converged: bool = False
    clock: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SensorPacket:
    """What the PC answers (EgmSensor): a position, and the speed that goes with it.

    Attributes:
        seq: Sequence number, counts modulo 2^32.
        time_ms: The sender's time [ms], modulo 2^32; 0 if it was left out.
        q_ref: Joint positions (n,) [rad].
        qd_ref: Joint speeds (n,) [rad/s].
    """

    seq: int
    time_ms: int
    q_ref: NDArray[np.float64]
    qd_ref: NDArray[np.float64]


def encode_robot(packet: RobotPacket, axes: Axes | None = None) -> bytes:
    """An EgmRobot datagram. Joint values are not checked: a simulated robot may send what it likes.

    Args:
        packet: What it says.
        axes: Which joints are external; by default those from the seventh on.

    Raises:
        ConfigurationError: Something of it cannot be put into a datagram.
    """
    axes = _check_sayable(packet, axes)
    message = _wire.EgmRobot()
    _set_header(message.header, packet.seq, packet.time_ms, _wire.EgmHeader.DATA)
    axes.write(message.feedBack, packet.q * axes.to_wire)
    if packet.clock is not None:
        seconds, micros = divmod(round(packet.clock * 1e6), 1_000_000)
        message.feedBack.time.sec, message.feedBack.time.usec = seconds, micros
    if packet.q_planned is not None:
        axes.write(message.planned, packet.q_planned * axes.to_wire)
    message.motorState.state = _wire.EgmMotorState.ON if packet.motors_on else _wire.EgmMotorState.OFF
    message.mciState.state = MCI_STATES.index(packet.mci)
    message.rapidExecState.state = RAPID_STATES.index(packet.rapid)
    message.mciConvergenceMet = bool(packet.converged)
    return message.SerializeToString()


def decode_robot(data: bytes, n: int | Axes) -> RobotPacket:
    """Read an EgmRobot datagram of a robot with n joints, or with these axes.

    States that are missing or unknown are taken for the safe ones: motors off, ``undefined``, not converged.

    Raises:
        MalformedPacket: It is none, or its joint values cannot be used.
    """
    axes = _axes("decode_robot", n)
    message = _parse(_wire.EgmRobot(), data)
    _check_header(message, _wire.EgmHeader.DATA)
    feedback = message.feedBack
    clock = (feedback.time.sec * 1_000_000 + feedback.time.usec) / 1e6 if _timed(feedback) else None
    planned = message.planned
    return RobotPacket(
        seq=message.header.seqno,
        time_ms=message.header.tm,
        q=_radians("feedBack", feedback, axes),
        q_planned=_radians("planned", planned, axes) if _given(planned) else None,
        motors_on=message.motorState.state == _wire.EgmMotorState.ON,
        mci=MCI_STATES[message.mciState.state],
        rapid=RAPID_STATES[message.rapidExecState.state],
        converged=message.mciConvergenceMet,
        clock=clock,
    )


def encode_sensor(packet: SensorPacket, axes: Axes | None = None) -> bytes:
    """An EgmSensor datagram; axes as for `encode_robot`.

    Raises:
        ValueError: A number is not finite, or positions and speeds differ in number: nothing a robot may be sent.
    """
    q, qd = np.asarray(packet.q_ref), np.asarray(packet.qd_ref)
    axes = axes_of(q.size) if axes is None else axes
    fits = q.shape == qd.shape == (axes.n,)
    if fits:
        q, qd = q * axes.to_wire, qd * axes.to_wire
    if not (fits and np.isfinite(q).all() and np.isfinite(qd).all()):
        raise ValueError(f"no reference for a robot: q_ref = {packet.q_ref}, qd_ref = {packet.qd_ref}")
    message = _wire.EgmSensor()
    _set_header(message.header, packet.seq, packet.time_ms, _wire.EgmHeader.CORRECTION)
    axes.write(message.planned, q)
    axes.write(message.speedRef, qd)
    return message.SerializeToString()


def decode_sensor(data: bytes, n: int | Axes) -> SensorPacket:
    """Read an EgmSensor datagram for a robot with n joints, or with these axes; no speedRef counts as zero speed.

    Raises:
        MalformedPacket: It is none, or its joint values cannot be used.
    """
    axes = _axes("decode_sensor", n)
    message = _parse(_wire.EgmSensor(), data)
    _check_header(message, _wire.EgmHeader.CORRECTION)
    speeds = message.speedRef
    return SensorPacket(
        seq=message.header.seqno,
        time_ms=message.header.tm,
        q_ref=_radians("planned", message.planned, axes),
        qd_ref=_radians("speedRef", speeds, axes) if _given(speeds) else np.zeros(axes.n),
    )


def _check_sayable(packet: RobotPacket, axes: Axes | None) -> Axes:
    """The axes, if all of a packet can be put into a datagram."""
    where = "RobotPacket"
    for key in ("seq", "time_ms"):
        whole(where, key, getattr(packet, key), "a whole number", -(2**63), 2**63)
    one_of(where, "mci", packet.mci, MCI_STATES)
    one_of(where, "rapid", packet.rapid, RAPID_STATES)
    for key in ("motors_on", "converged"):
        if not isinstance(getattr(packet, key), bool | np.bool_):
            raise ConfigurationError(where, key, getattr(packet, key), "True or False")
    if packet.clock is not None and not number(where, "clock", packet.clock, _CLOCK, 0.0) < 2.0**63:
        raise ConfigurationError(where, "clock", packet.clock, _CLOCK)
    q = numbers(where, "q", packet.q, "joint values, one a joint")
    found = axes_of(q.size) if axes is None else _axes("encode_robot", axes)
    expected = f"values of {counted(found.n, 'joint')}"
    planned = q if packet.q_planned is None else numbers(where, "q_planned", packet.q_planned, expected)
    for key, values in (("q", q), ("q_planned", planned)):
        if values.shape != (found.n,):
            raise ConfigurationError(where, key, getattr(packet, key), expected)
    return found


def _axes(where: str, n: int | Axes) -> Axes:
    if isinstance(n, Axes):
        return n
    return axes_of(whole(where, "n", n, "a number of joints, 0 to 255, or Axes", 0, 255))


def _set_header(header: Any, seq: int, time_ms: int, kind: int) -> None:
    header.seqno, header.tm, header.mtype = int(seq) % WRAP, int(time_ms) % WRAP, kind


def _parse(message: Any, data: bytes) -> Any:
    if not 0 < len(data) <= MAX_SIZE:
        raise MalformedPacket(GARBAGE, f"a datagram of {len(data)} bytes, expected 1 to {MAX_SIZE}")
    try:
        message.ParseFromString(data)
    except Exception as error:  # which kind it is differs between the parsers of protobuf
        raise MalformedPacket(GARBAGE, f"no EGM message: {error}") from None
    return message


def _check_header(message: Any, kind: int) -> None:
    header = message.header
    if not (header.HasField("seqno") and header.HasField("mtype")):  # tm is left out by some
        raise MalformedPacket(INCOMPLETE, "the header lacks seqno or mtype")
    if header.mtype != kind:
        raise MalformedPacket(WRONG_KIND, f"message type {header.mtype}, expected {kind}")


def _timed(feedback: Any) -> bool:
    return feedback.time.HasField("sec") and feedback.time.HasField("usec")


def _given(message: Any) -> bool:
    """Whether there are any joint values."""
    return bool(message.joints.joints or message.externalJoints.joints)


def _radians(name: str, message: Any, axes: Axes) -> NDArray[np.float64]:
    """Joint values (n,) [rad] of a message with both lists, in the robot's order."""
    inner, outer = message.joints.joints, message.externalJoints.joints
    for part, found, places in (("joints", inner, axes.inner), ("externalJoints", outer, axes.outer)):
        if len(found) != len(places):
            raise MalformedPacket(WRONG_JOINT_COUNT, f"{name}.{part}: {len(found)} numbers, expected {len(places)}")
    q = np.array(inner, dtype=np.float64)
    if len(outer):
        q, first = np.empty(axes.n), q
        q[axes.inner], q[axes.outer] = first, outer
    if not np.isfinite(q).all():
        raise MalformedPacket(NOT_FINITE, f"{name}: {q}")
    return q * axes.from_wire


def newer(seq: int, than: int) -> bool:
    """Whether sequence number `seq` comes after `than`, modulo 2^32."""
    return 0 < (seq - than) % WRAP < WRAP // 2
