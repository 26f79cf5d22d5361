"""The robot's own body for self-detection: the collision geometry of its model as convex hulls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from qpsafe.robot.models.hulls import BodyHull
from qpsafe.sensing.hulls import HullSet, Obstacle

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

_loaded: WeakKeyDictionary[Robot, tuple[BodyHull, ...]] = WeakKeyDictionary()
_sets: WeakKeyDictionary[Robot, HullSet] = WeakKeyDictionary()


def body_hulls(robot: Robot) -> tuple[BodyHull, ...]:
    """Hulls of the robot's collision geometry; none if its model has none. Loaded once a robot.

    Raises:
        RobotFileError: The geometry cannot be read, or it has a shape that has no hull.
    """
    if robot not in _loaded:
        _loaded[robot] = tuple(robot.hulls())
    return _loaded[robot]


def body_hull_set(robot: Robot) -> HullSet:
    """The same hulls, ready to be searched; computed once a robot."""
    if robot not in _sets:
        _sets[robot] = HullSet(body_hulls(robot))
    return _sets[robot]


def fixed_to(robot: Robot, frame: str, thing: Obstacle) -> BodyHull:
    """A thing that moves with a frame of the robot, given in the frame's axes, e.g. a workpiece in its gripper.

    Args:
        robot: The robot.
        frame: One of its frames.
        thing: Its hull, in the frame's axes.

    Raises:
        ConfigurationError: The robot has no such frame.
    """
    found = robot.model.frames[robot.frame_id(frame)]
    placement = found.placement.homogeneous
    return int(found.parentJoint), thing.name, thing.vertices @ placement[:3, :3].T + placement[:3, 3]


def surrounding_hulls(
    robot: Robot, own: bool, known: Sequence[Obstacle], carried: Mapping[str, Sequence[Obstacle]] | None
) -> HullSet:
    """What is no danger when it is seen: known obstacles, on body 0, the world; the robot; what its tools may carry.

    Args:
        robot: The robot.
        own: Whether the robot itself belongs to it.
        known: Known obstacles.
        carried: What tools may carry, by frame.
    """
    hulls = HullSet([(0, obstacle.name, obstacle.vertices) for obstacle in known])
    if own:
        hulls = hulls + body_hull_set(robot)
    for frame, things in ({} if carried is None else carried).items():
        hulls = hulls + HullSet([fixed_to(robot, frame, thing) for thing in things])
    return hulls
