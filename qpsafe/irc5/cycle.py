"""One packet of the robot to answer, and what kind of answer it gets."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from qpsafe.irc5.messages import RobotPacket

Array = NDArray[np.float64]


class Phase(StrEnum):
    """What the robot is being answered."""

    WAITING = "waiting"  # nothing yet: it has not spoken
    HOLDING = "holding"  # its own measured pose, at speed 0: motors off, motion control or RAPID program not running
    RAMPING = "ramping"  # the source, blended in from the measured pose
    RUNNING = "running"  # the source
    STOPPING = "stopping"  # a pose that comes to rest
    STOPPED = "stopped"  # a pose at rest, until acknowledged


@dataclass(frozen=True, slots=True, eq=False)
class Cycle:
    """A packet to answer.

    Attributes:
        packet: What the robot says.
        qd: Measured joint velocity (n,) [rad/s], by the robot's clock from this packet and the one before.
        phase: What it will be answered.
        seeded: The reference was set to the measured pose: let the source of references start anew from it.
        missed: Packets missing since the last cycle, lost or superseded by this one.
        deviation: How far every joint is from what it was sent (n,) [rad].
        notes: What is unusual, in words.
        waited: How long the packet had waited unread at this computer [s].
    """

    packet: RobotPacket
    qd: Array
    phase: Phase
    seeded: bool
    missed: int
    deviation: Array
    notes: tuple[str, ...] = ()
    waited: float = 0.0

    @property
    def moving(self) -> bool:
        """Whether the answer follows the source of references."""
        return self.phase in (Phase.RAMPING, Phase.RUNNING)
