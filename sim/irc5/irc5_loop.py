"""An experiment with a simulated IRC5 between controller and plant; the controller may be in this process or far away.

The loops of the experiments (`FixedLoop`, `PickLoop`) sense, ask their controller for a reference and tell it to their
plant. Here both are replaced: the plant by one that an IRC5's motion law drives, the controller by an `Exchange` of
EGM packets for answers. Everything else, people, sensors and gripper, is the experiment's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.irc5.messages import RobotPacket, SensorPacket
from qpsafe.reference import JointReference
from qpsafe.sim.irc5.controller import SimulatedIrc5
from qpsafe.sim.irc5.motion import EgmSettings
from qpsafe.sim.world.plant import Plant

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]


class Exchange(Protocol):
    """The other end of the wire."""

    def swap(self, packet: RobotPacket | None, distances: Array) -> tuple[Sequence[SensorPacket], Sequence[str]]:
        """Send a packet and the spots' readings; the answers that have come, and names of events."""


class Answered(NamedTuple):
    """What an experiment's loop needs of a tick."""

    reference: JointReference
    events: tuple[str, ...]


class DrivenPlant:
    """A plant that a simulated IRC5 drives: what the experiment applies itself does not count."""

    def __init__(self, plant: Plant, irc5: SimulatedIrc5) -> None:
        self._plant, self._irc5 = plant, irc5

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def apply(self, q_ref: Array, qd_ref: Array) -> bool:
        """Ignored: the motion law applies."""
        return True

    def advance(self) -> None:
        """One cycle of the controller."""
        self._irc5.advance()


class FarController:
    """Stands in an experiment's loop for the controller at the other end of the wire.

    Args:
        robot: The robot.
        irc5: Its controller.
        exchange: Sends a packet and takes what has come.
        dt: Tick [s].
    """

    def __init__(self, robot: Robot, irc5: SimulatedIrc5, exchange: Exchange, dt: float) -> None:
        self.robot, self.dt = robot, dt
        self._irc5, self._exchange = irc5, exchange

    def step(self, q: Array, qd: Array, distances: Array, *, ages: Array | None = None) -> Answered:
        """Send what the robot measures and take what has come; in lock-step, the answer to this very packet.

        Args:
            q: Measured joint position (n,) [rad].
            qd: Unused: EGM has no velocities.
            distances: Of the spots (k,) [m].
            ages: Unused: they are fresh.
        """
        irc5 = self._irc5
        packet = irc5.packet()
        answers, events = self._exchange.swap(packet, distances)
        if packet is not None:
            irc5.take(answers)
        return Answered(JointReference(0, irc5.time, q, np.zeros_like(q)), tuple(events))


class Irc5Loop:
    """An experiment over the wire.

    Args:
        loop: Of the experiment, e.g. `FixedLoop(experiment)`; taken over.
        exchange: The other end.
        settings: Of EGM; its control lag becomes the plant's.
        period: After this time people begin anew [s]; None: never.

    Attributes:
        irc5: The simulated controller.
        running: Whether people and clocks of the experiment go on: from the first answer.
    """

    def __init__(
        self, loop: Any, exchange: Exchange, settings: EgmSettings | None = None, period: float | None = None
    ) -> None:
        settings = EgmSettings() if settings is None else settings
        self.loop = loop
        self._period = None if period is None else round(period / loop.controller.dt)
        self.plant = Plant(loop.scene, lag=settings.lag, q=loop.plant.q)
        dt = loop.controller.dt
        self.irc5 = SimulatedIrc5(self.plant, settings, dt)
        loop.controller = FarController(loop.controller.robot, self.irc5, exchange, dt)
        loop.plant = DrivenPlant(self.plant, self.irc5)

    @property
    def running(self) -> bool:
        """Whether the robot has been answered."""
        return self.irc5.counts.answered > 0

    def step(self) -> Any:
        """Sense and swap; what the experiment's own step returns."""
        if not self.running or self.loop.k == self._period:
            self.loop.k = 0
        return self.loop.step()

    def advance(self) -> None:
        """Move on by one cycle."""
        self.loop.advance()
