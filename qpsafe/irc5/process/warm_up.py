"""Everything that is slow only once, before the robot waits for it: compiled kernels, caches, the protobuf parser."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from qpsafe.irc5.messages import RobotPacket, decode_robot, encode_robot
from qpsafe.irc5.session import EgmSession
from qpsafe.irc5.transport.axes import axes_of_robot
from qpsafe.limits import JointLimits

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController


def session_limits(controller: SafetyController) -> JointLimits:
    """Limits for the session: the controller's own, or, if it has none, the robot's."""
    own = controller.limits
    return JointLimits.of(controller.robot, controller.dt) if isinstance(own, str) else own


def warm_up(controller: SafetyController, blind: bool, ticks: int = 300) -> None:
    """Run controller and session on a pretended robot through all regimes, then make the controller as new.

    Args:
        controller: Left as new.
        blind: Whether it will run without distances.
        ticks: How many.
    """
    axes = axes_of_robot(controller.robot)
    session = EgmSession(session_limits(controller), joint_names=controller.robot.joint_names, axes=axes)
    q, count = controller.robot.home, 0 if controller.spots is None else len(controller.spots)
    for k in range(ticks):
        data = encode_robot(RobotPacket(k, 4 * k, q, q, clock=1.0 + 0.004 * k), axes)
        decode_robot(data, axes)
        session.offer(data, ("127.0.0.1", 1), 0.004 * k)
        cycle = session.take()
        if cycle is None:
            continue
        near = 0.5 + 0.3 * np.cos(2.0 * np.pi * k / ticks) + 1e-3 * np.arange(count)
        if blind or count == 0:
            tick = controller.step(q, np.zeros_like(q), points=np.empty((0, 3)))
        else:
            tick = controller.step(q, np.zeros_like(q), near)
        session.answer(tick.reference)
        q = session.q
    controller.reset()
