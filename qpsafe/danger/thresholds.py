"""Danger thresholds of a robot: those of its file, or the paper's carried over to it by a rule.

The field sums over the links of the wire, so the same distance means another danger on another robot. The paper tuned
Δ = 11.5 and Δ_f = 7.5 on the IRB 140. The rule: at rest at home, a point `REFERENCE_DISTANCE` in front of a tool must
stand in the same relation to the thresholds as it does there,

    Δ = 11.5 F / F_irb140,  Δ_f = 7.5 F / F_irb140,

with F the largest field over the robot's tools. Both grow by one factor, so Table I's condition stays met.

"In front" is horizontally away from what the tool's arm stands on, wherever that is: F is the same for a robot that is
moved or turned about z. The point keeps the distance from every link of the wire, the other arms' too; where an arm is
in the way it turns to the nearest side that is clear, and only if there is none does it go farther out. A point inside
the robot would make F, and with it the thresholds, so large that the robot evades nobody.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from qpsafe.danger.activation import Activation, Threshold
from qpsafe.danger.field import DangerField
from qpsafe.robot.robot_file.spec import WORLD

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.wire import Wire

#: (Δ, ε) of the task of high priority and (Δ_f, ε_f) of the low one, section V-C.
SOURCE = (Threshold(11.5, 0.15), Threshold(7.5, 0.25))
#: How far in front of a tool, horizontally away from the base, robots are compared [m], and the IRB 140's field there.
REFERENCE_DISTANCE, REFERENCE_FIELD = 0.4, 9.53
#: Directions that are tried, from the front to both sides [deg], and how the distance grows if none is clear.
_TURNS = np.radians([0.0, *(sign * angle for angle in range(15, 180, 15) for sign in (1, -1)), 180.0])
_FARTHER, _TOLERANCE = 1.25, 1e-6


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
    wire = state.wire(np.zeros(robot.nq))
    bases = _bases(robot)
    points = [_in_front(state.position(tool), base, wire) for tool, base in zip(robot.tool_frames, bases, strict=True)]
    value, _ = DangerField().evaluate(np.array(points), wire)
    return float(value.max())


def _in_front(tip: NDArray[np.float64], base: Any, wire: Wire) -> NDArray[np.float64]:
    """The first place before a tip that is clear of the robot, (3,) [m].

    Args:
        tip: Of the tool (3,) [m].
        base: Pose of what its arm stands on; where the tip is straight above, the front is its x axis.
        wire: The robot at rest.
    """
    away = tip[:2] - base.translation[:2]
    if np.hypot(*away) <= _TOLERANCE:
        ahead, aside = base.rotation[:2, 0], base.rotation[:2, 1]
        away = ahead if np.hypot(*ahead) > 0.5 else aside
    x, y = away / np.hypot(*away)
    around = np.stack((np.cos(_TURNS) * x - np.sin(_TURNS) * y, np.sin(_TURNS) * x + np.cos(_TURNS) * y), axis=1)
    reach = REFERENCE_DISTANCE
    while True:  # ends beyond the robot's farthest link
        points = tip + reach * np.column_stack((around, np.zeros(len(around))))
        clear = _distances(points, wire) >= REFERENCE_DISTANCE - _TOLERANCE
        if clear.any():
            return points[int(clear.argmax())]
        reach *= _FARTHER


def _distances(points: NDArray[np.float64], wire: Wire) -> NDArray[np.float64]:
    """From each of some points to the nearest link (p,) [m]."""
    along = wire.ends - wire.starts
    to = points[:, None] - wire.starts
    part = (to * along).sum(axis=2) / np.maximum((along * along).sum(axis=1), np.finfo(float).tiny)
    return np.linalg.norm(to - np.clip(part, 0.0, 1.0)[..., None] * along, axis=2).min(axis=1)


def _bases(robot: Robot) -> list[Any]:
    """Pose of what each tool's arm stands on: the link that all arms share, such as a torso, else each one's own."""
    model = robot.model
    firsts = [_first_joint(model, robot.mounting(tool)[0]) for tool in robot.tool_frames]
    below = [list(_links_below(model, joint)) for joint in firsts]
    shared = set.intersection(*map(set, below)) if below else set()
    bases = []
    for joint, links in zip(firsts, below, strict=True):
        nearest = [link for link in links if link in shared] or links
        # a joint that stands on the world itself is its own base
        bases.append(model.frames[nearest[0]].placement if nearest else model.jointPlacements[joint])
    return bases


def _first_joint(model: Any, joint: int) -> int:
    """The joint nearest to the base on the way to a joint; 0 for what does not move."""
    while joint and model.parents[joint]:
        joint = model.parents[joint]
    return int(joint)


def _links_below(model: Any, joint: int) -> Iterator[int]:
    """Frames of the fixed links that a joint stands on, from the joint down to the world, which is none."""
    frame = next((f.parentFrame for f in model.frames if f.parentJoint == joint and f.type == pin.FrameType.JOINT), 0)
    while frame:
        here = model.frames[frame]
        if here.type == pin.FrameType.BODY and here.name not in WORLD:
            yield frame
        frame = 0 if here.parentFrame == frame else here.parentFrame  # a joint that is held is its own parent
