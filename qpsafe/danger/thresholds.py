"""Danger thresholds of a robot: those of its file, or the paper's carried over to it by a rule.

The field sums over the links of the wire, so the same distance means another danger on another robot. The paper tuned
Δ = 11.5 and Δ_f = 7.5 on the IRB 140. The rule: at rest at home, a point `REFERENCE_DISTANCE` in front of a tool must
stand in the same relation to the thresholds as it does there,

    Δ = 11.5 F / F_irb140,  Δ_f = 7.5 F / F_irb140,

with F the largest field over the robot's tools. Both grow by one factor, so Table I's condition stays met.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from qpsafe.danger.activation import Activation, Threshold
from qpsafe.danger.field import DangerField

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

#: (Δ, ε) of the task of high priority and (Δ_f, ε_f) of the low one, section V-C.
SOURCE = (Threshold(11.5, 0.15), Threshold(7.5, 0.25))
#: How far in front of a tool, horizontally away from the base, robots are compared [m], and the IRB 140's field there.
REFERENCE_DISTANCE, REFERENCE_FIELD = 0.4, 9.53


def robot_thresholds(robot: Robot) -> tuple[Threshold, Threshold]:
    """Δ, ε and Δ_f, ε_f of a robot: those its file states, else by the rule above."""
    if robot.danger is not None:
        high, low = robot.danger
        return Threshold(*high), Threshold(*low)
    factor = reference_field(robot) / REFERENCE_FIELD
    m, f = (Threshold(round(factor * threshold.delta, 2), threshold.epsilon) for threshold in SOURCE)
    return m, f


def robot_activation(robot: Robot, high: int = 1, low: int = 1) -> Activation:
    """The activation of a robot with several tasks at a level, such as one of each kind for each of its tools.

    Args:
        robot: The robot.
        high: How many tasks of high priority there are; they come first and are released last, together.
        low: How many of low priority; they are released first, together.
    """
    keep, release = robot_thresholds(robot)
    return Activation((keep,) * high + (release,) * low)


def reference_field(robot: Robot) -> float:
    """F [1/m]: the field of the robot at rest at home, `REFERENCE_DISTANCE` in front of a tool; the largest of all."""
    state = robot.at(robot.home)
    points = []
    for frame in robot.tool_frames:
        tip = state.position(frame)
        away = tip[:2] / max(float(np.hypot(*tip[:2])), 1e-9) if np.hypot(*tip[:2]) > 1e-6 else np.array([1.0, 0.0])
        points.append(tip + REFERENCE_DISTANCE * np.append(away, 0.0))
    value, _ = DangerField().evaluate(np.array(points), state.wire(np.zeros(robot.nq)))
    return float(value.max())
