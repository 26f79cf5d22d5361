"""The cases of the fault matrix: what the robot, its wire or somebody else does, and what is promised."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from qpsafe.irc5.messages import RobotPacket, encode_robot
from qpsafe.irc5.supervisor import StopCategory
from qpsafe.sim.irc5.bench import Datagrams, Workbench
from qpsafe.sim.irc5.in_process import ROBOT_ADDRESS
from qpsafe.sim.irc5.link import NO_FAULTS, WireFaults
from qpsafe.sim.irc5.reactions import (
    Seen,
    counted,
    goes_on,
    held,
    left,
    refused,
    reseeded,
    reseeded_or_stopped,
    stopped,
)

STRANGER = ("127.0.0.1", 6666)
FAR = 1000  # longer than any window

#: Does something to the robot or the wire.
Fault = Callable[[Workbench], None]


class Case(NamedTuple):
    """One line of the matrix.

    Attributes:
        name: What happens.
        promise: What the streamer must do.
        within: Ticks that may take.
        start: Does it.
        end: Takes it back after `lasts` ticks.
        lasts: For how long.
        window: Ticks that are looked at.
        seen: Finds the reaction.
        wraps: The robot's sequence number wraps around at the moment instead.
    """

    name: str
    promise: str
    within: int
    start: Fault
    seen: Seen
    end: Fault = lambda bench: None
    lasts: int = FAR
    window: int = 150
    wraps: bool = False


def _wire(out: WireFaults = NO_FAULTS, back: WireFaults = NO_FAULTS) -> Fault:
    def do(bench: Workbench) -> None:
        bench.out.faults, bench.back.faults = out, back

    return do


def _instead(change: Callable[[RobotPacket], RobotPacket], sender: tuple[str, int] = ROBOT_ADDRESS) -> Fault:
    """Every packet of the robot is replaced."""
    return _spoil(lambda packet, datagrams: [(encode_robot(change(packet)), sender)])


def _besides(change: Callable[[RobotPacket], bytes], sender: tuple[str, int] = ROBOT_ADDRESS) -> Fault:
    """After every packet of the robot comes something else."""
    return _spoil(lambda packet, datagrams: [*datagrams, (change(packet), sender)])


def _spoil(change: Callable[[RobotPacket, Datagrams], Datagrams]) -> Fault:
    def do(bench: Workbench) -> None:
        bench.spoil = lambda packet, datagrams: datagrams if packet is None else change(packet, datagrams)

    return do


def _well(bench: Workbench) -> None:
    bench.spoil, bench.out.faults, bench.back.faults = None, NO_FAULTS, NO_FAULTS


def _joints(packet: RobotPacket, value: float) -> RobotPacket:
    q = packet.q.copy()
    q[2] = value
    return dataclasses.replace(packet, q=q)


def _emergency(bench: Workbench) -> None:
    bench.irc5.motors(False)
    bench.irc5.mci = "error"


def _released(bench: Workbench) -> None:
    bench.irc5.mci = "stopped"
    bench.irc5.motors(True)


def _leave(bench: Workbench) -> None:
    bench.here.loop.stop(StopCategory.CONTROLLED_THEN_SILENT, "Ctrl-C")


def _blind(bench: Workbench) -> None:
    bench.blind = True


SILENT = 26  # ticks: 0.1 s without a packet, and the tick in which that is seen
BLIND = 15  # ticks: a reading counts for 40 ms; then five unusable ticks
LEFT = 140  # ticks: the slowest joint brakes from full speed in 84, the pose is sent for 50 more

CASES: tuple[Case, ...] = (
    Case("an answer lost", "goes on", 1, _wire(back=WireFaults(loss=1.0)), goes_on, _well, 1),
    Case("a fifth of the answers lost", "goes on", 1, _wire(back=WireFaults(loss=0.2)), goes_on, _well, 100),
    Case("answers 12 ms late", "goes on", 1, _wire(back=WireFaults(delay=0.012)), goes_on, _well, 100),
    Case(
        "no answers until CommTimeout",
        "re-seeds, or has stopped",
        1,
        _wire(back=WireFaults(loss=1.0)),
        reseeded_or_stopped,
        _well,
        126,
        400,
    ),
    Case("a packet lost", "goes on", 1, _wire(WireFaults(loss=1.0)), goes_on, _well, 1),
    Case("a fifth of the packets lost", "goes on", 1, _wire(WireFaults(loss=0.2)), goes_on, _well, 100),
    Case("packets 12 ms late", "goes on", 1, _wire(WireFaults(delay=0.012)), goes_on, _well, 100),
    Case("packets lost for 60 ms", "goes on", 1, _wire(WireFaults(loss=1.0)), goes_on, _well, 15),
    Case(
        "packets lost for 0.3 s",
        "stops, until acknowledged",
        SILENT,
        _wire(WireFaults(loss=1.0)),
        stopped("silent"),
        _well,
        75,
        250,
    ),
    Case("every packet twice", "answers once", 2, _wire(WireFaults(duplicate=1.0)), counted("duplicate", "stale")),
    Case("half of them out of order", "drops older ones", 1, _wire(WireFaults(reorder=0.5)), goes_on),
    Case("junk after every packet", "rejects, counts", 1, _wire(WireFaults(garbage=1.0)), counted("garbage")),
    Case(
        "somebody else sends",
        "rejects, pinned",
        1,
        _besides(lambda p: encode_robot(_joints(p, 0.0)), STRANGER),
        counted("wrong_sender"),
    ),
    Case(
        "an old packet after each",
        "drops it",
        1,
        _besides(lambda p: encode_robot(dataclasses.replace(_joints(p, 0.0), seq=p.seq - 5))),
        counted("stale"),
    ),
    Case(
        "NaN for a joint, 40 ms",
        "rejects, counts",
        1,
        _instead(lambda p: _joints(p, np.nan)),
        refused("not_finite"),
        _well,
        10,
    ),
    Case(
        "infinity for a joint, 40 ms",
        "rejects, counts",
        1,
        _instead(lambda p: _joints(p, np.inf)),
        refused("not_finite"),
        _well,
        10,
    ),
    Case(
        "1e6 deg for a joint, 40 ms",
        "rejects, counts",
        1,
        _instead(lambda p: _joints(p, np.deg2rad(1e6))),
        refused("implausible"),
        _well,
        10,
    ),
    Case(
        "seven joints, 40 ms",
        "rejects, counts",
        1,
        _instead(lambda p: dataclasses.replace(p, q=np.append(p.q, 0.0), q_planned=None)),
        refused("wrong_joint_count"),
        _well,
        10,
    ),
    Case(
        "no feedBack.time, 40 ms",
        "refuses",
        1,
        _instead(lambda p: dataclasses.replace(p, clock=None)),
        refused("no_clock"),
        _well,
        10,
    ),
    Case("the robot restarts", "re-seeds, ramps in", 1, lambda b: b.irc5.restart(0.1), reseeded, window=300),
    Case(
        "motors off for 0.4 s",
        "holds the measured pose",
        1,
        lambda b: b.irc5.motors(False),
        held,
        lambda b: b.irc5.motors(True),
        100,
        300,
    ),
    Case("emergency stop, 0.4 s", "holds the measured pose", 1, _emergency, held, _released, 100, 300),
    Case(
        "RAPID stopped for 0.4 s",
        "holds the measured pose",
        1,
        lambda b: b.irc5.program(False),
        held,
        lambda b: b.irc5.program(True),
        100,
        300,
    ),
    Case("sequence number wraps around", "goes on", 1, lambda b: None, goes_on, wraps=True),
    Case("Ctrl-C", "ramps out, then silent", LEFT, _leave, left, window=250),
    Case("distances stop coming", "stops, until acknowledged", BLIND, _blind, stopped("controller"), window=250),
)
