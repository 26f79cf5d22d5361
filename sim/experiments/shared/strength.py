"""What the torques that a file states can do: hold the arm, and move it as fast as was assumed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from qpsafe.sim.world.robot_spec import UNSTATED, torques

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

STRONG = 0.9  # share of a motor's torque that motion may take
LEAST = (
    0.1  # share of assumed accelerations below which they are not reduced: an arm that cannot do that can do nothing
)


def bearable(robot: Robot) -> tuple[float, list[str]]:
    """How much of assumed accelerations the stated torques can bear, and what is to be said of it.

    Args:
        robot: With the accelerations that were assumed.

    Returns:
        A share, `LEAST` to 1, and words: of less than all of them, and of joints that some postures are too heavy for.
    """
    stated = np.ravel(robot.model.effortLimit)
    known = (stated > 0.0) & (stated < UNSTATED)
    if not known.any():
        return 1.0, []
    moving, holding = torques(robot)
    room = ((STRONG * stated - holding) / np.maximum(moving, 1e-9)).min(axis=0)
    most, heavy = holding.max(axis=0), known & (holding.max(axis=0) > stated)
    share = float(np.clip(room[known].min(), LEAST, 1.0))
    said = [
        f"joint {robot.joint_names[j]}: up to {most[j]:.3g} N m hold it, {stated[j]:.3g} are stated: it sinks in some "
        "postures"
        for j in np.flatnonzero(heavy)
    ]
    if share < 1.0:
        slow = ", ".join(robot.joint_names[j] for j in np.flatnonzero(known & (room < LEAST)))
        why = f"even these the stated torques of {slow} do not bear" if slow else "more the stated torques cannot bear"
        said.append(f"accelerations reduced to {math.floor(100 * share)} %: {why} everywhere")
    return share, said
