"""A robot that is always on the move, with `qpsafe stream`'s loop at the other end of a wire that can be spoiled.

Simulated time, no sockets, and a copy can be taken at any moment: what the fault matrix is made of.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.controller import SafetyController
from qpsafe.irc5.messages import RobotPacket, encode_robot
from qpsafe.robot.robot import Robot
from qpsafe.sim.experiments.path.experiment import PROGRAM
from qpsafe.sim.irc5.controller import IdealBody, SimulatedIrc5
from qpsafe.sim.irc5.in_process import ROBOT_ADDRESS, Here
from qpsafe.sim.irc5.link import NO_FAULTS, Wire
from qpsafe.sim.irc5.motion import EgmSettings
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.program_file import load_program
from qpsafe.tasks.reach import joints_for

Array = NDArray[np.float64]
Datagrams = list[tuple[bytes, tuple[str, int]]]


class Turn(NamedTuple):
    """One cycle of the robot, seen from outside.

    Attributes:
        q: Measured, as sent (n,) [rad].
        moved: Measured since the cycle before (n,) [rad].
        q_ref, qd_ref: The answer (n,), None without one.
        answers: How many answers were given.
        seeded: Whether the session started anew from the measured pose.
        state: Of the supervisor.
        ready: Motors, motion control and program run.
        causes: Of the supervisor.
        counts: Of the session, up to now.
    """

    q: Array
    moved: Array
    q_ref: Array | None
    qd_ref: Array | None
    answers: int
    seeded: bool
    state: str
    ready: bool
    causes: tuple[str, ...]
    counts: dict[str, int]


class Workbench:
    """Robot, wire, loop and controller.

    Args:
        robot: The robot, with spots.
        seq: First sequence number of the robot.
        seed: Of the wire's faults.

    Attributes:
        spoil: Called with the robot's packet and its datagrams in every cycle; returns what is sent instead.
        blind: Whether distances have stopped coming: the last ones grow older.
    """

    def __init__(self, robot: Robot, seq: int = 0, seed: int = 0) -> None:
        program = load_program(PROGRAM, robot)
        tasks = [PositionTask("tcp", program), OrientationTask("tcp", program)]
        start = joints_for(robot, "tcp", program.sample(0.0).pose, robot.home)
        self.robot, self.program = robot, program
        self.here = Here(SafetyController(robot, tasks))
        self.irc5 = SimulatedIrc5(
            IdealBody(start), EgmSettings(comm_timeout=0.5, retry=0.2), axes=self.here.loop.session.axes
        )
        self.irc5.seq = seq
        self.out, self.back = (Wire(NO_FAULTS, np.random.default_rng((seed, k))) for k in range(2))
        self.spoil: Callable[[RobotPacket | None, Datagrams], Datagrams] | None = None
        self.blind, self._age = False, 0.0
        self.k = 0
        count = 0 if self.here.loop.controller.spots is None else len(self.here.loop.controller.spots)
        self._phases = np.random.default_rng(5).uniform(0.0, 2.0 * np.pi, count)
        self._before, self._distances = start, self.distances()

    def distances(self) -> Array:
        """Somebody passes before one spot after the other, now and then near enough to be evaded (k,) [m]."""
        wave = np.cos(2.0 * np.pi * self.k * 0.004 / 3.0 + self._phases)
        return np.where(wave > 0.9, 0.75 - 3.5 * (wave - 0.9), np.inf)

    def turn(self) -> Turn:
        """One cycle: the robot moves, takes the answers that have come and sends; the loop answers what has come."""
        irc5, here = self.irc5, self.here
        irc5.advance()
        came = self.back.take()
        packet = irc5.packet()
        irc5.receive(came)
        if packet is not None:
            self.out.put(encode_robot(packet, irc5.axes))
        datagrams: Datagrams = [(data, ROBOT_ADDRESS) for data in self.out.take()]
        if self.spoil is not None:
            datagrams = self.spoil(packet, datagrams)
        self._age = self._age + irc5.dt if self.blind else 0.0
        self._distances = self._distances if self.blind else self.distances()
        answers = here.receive(datagrams, self._distances, self._age)
        for data in answers:
            self.back.put(data)
        session, supervisor = here.loop.session, here.loop.supervisor
        q, self._before, before = irc5.body.q, irc5.body.q, self._before
        self.k += 1
        return Turn(
            q=q,
            moved=q - before,
            q_ref=session.q.copy() if answers else None,
            qd_ref=session.qd.copy() if answers else None,
            answers=len(answers),
            seeded=here.cycle is not None and here.cycle.seeded,
            state=supervisor.state.value,
            ready=irc5.motors_on and irc5.rapid and irc5.mci == "running",
            causes=supervisor.causes,
            counts=dict(session.counts),
        )

    def copy(self) -> Workbench:
        """As it is now, to go on in another way."""
        shared = (self.robot, self.here.loop.controller.law, self.program)
        return copy.deepcopy(self, {id(item): item for item in shared})
