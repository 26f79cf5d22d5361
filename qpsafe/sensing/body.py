"""The robot's own body for self-detection: the collision geometry of its model as convex hulls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.sensing.hulls import HullSet, Obstacle

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

#: A hull of the body: the joint that moves it (0: none), its name, its vertices in that joint's frame (v, 3) [m].
BodyHull = tuple[int, str, NDArray[np.float64]]

_ROUND = 24  # corners of the polygons that stand for circles
_loaded: WeakKeyDictionary[Robot, tuple[BodyHull, ...]] = WeakKeyDictionary()
_sets: WeakKeyDictionary[Robot, HullSet] = WeakKeyDictionary()


def body_hulls(robot: Robot) -> tuple[BodyHull, ...]:
    """Hulls of the robot's collision geometry; none if its model has none. Loaded once a robot.

    Raises:
        RobotFileError: pinocchio cannot read the geometry, or it has a shape that has no hull.
    """
    if robot not in _loaded:
        _loaded[robot] = _load(robot)
    return _loaded[robot]


def body_hull_set(robot: Robot) -> HullSet:
    """The same hulls, ready to be searched; computed once a robot."""
    if robot not in _sets:
        _sets[robot] = HullSet(body_hulls(robot))
    return _sets[robot]


def fixed_to(robot: Robot, frame: str, thing: Obstacle) -> BodyHull:
    """A thing that moves with a frame of the robot, given in the frame's axes, e.g. a workpiece in its gripper.

    Raises:
        ConfigurationError: The robot has no such frame.
    """
    found = robot.model.frames[robot.frame_id(frame)]
    placement = found.placement.homogeneous
    return int(found.parentJoint), thing.name, thing.vertices @ placement[:3, :3].T + placement[:3, 3]


def _load(robot: Robot) -> tuple[BodyHull, ...]:
    from qpsafe.robot.model_file import collision_geometry

    path = robot.model_path
    try:
        geometry = collision_geometry(path, robot.model)
    except (ValueError, RuntimeError) as error:
        raise RobotFileError(path, "collision geometry", path.name, f"one that pinocchio can read ({error})") from error
    hulls = []
    for item in geometry.geometryObjects:
        corners = _corners(item.geometry) * np.asarray(item.meshScale)
        if not len(corners):
            raise RobotFileError(
                path, item.name, type(item.geometry).__name__, "a mesh, box, sphere, capsule, cylinder"
            )
        placement = item.placement.homogeneous
        hulls.append((int(item.parentJoint), item.name, corners @ placement[:3, :3].T + placement[:3, 3]))
    return tuple(hulls)


def _corners(shape: Any) -> NDArray[np.float64]:
    """Vertices whose hull contains a shape of coal, round ones slightly enlarged; none for unknown shapes."""
    kind = type(shape).__name__
    if kind.startswith("Convex"):
        return np.array(shape.points(), dtype=float)
    if kind.startswith("BVHModel"):
        return np.array(shape.vertices(), dtype=float)
    if kind == "Box":
        half = np.asarray(shape.halfSide)
        return np.array(np.meshgrid(*np.stack((-half, half), axis=1))).reshape(3, -1).T
    if kind == "Sphere":
        return shape.radius * _ball()
    if kind == "Capsule":
        offset = np.array([0.0, 0.0, shape.halfLength])
        return np.vstack((shape.radius * _ball() + offset, shape.radius * _ball() - offset))
    if kind == "Cylinder":
        return np.vstack([_ring(shape.radius, z) for z in (-shape.halfLength, shape.halfLength)])
    return np.zeros((0, 3))


def _ring(radius: float, z: float) -> NDArray[np.float64]:
    """A regular polygon around a circle."""
    angle = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    outer = radius / np.cos(np.pi / _ROUND)
    return np.stack((outer * np.cos(angle), outer * np.sin(angle), np.full(_ROUND, z)), axis=1)


def _ball() -> NDArray[np.float64]:
    """A polyhedron around the unit ball: polygons at several latitudes and the poles."""
    latitudes = np.pi * (np.arange(1, _ROUND // 2) / (_ROUND // 2) - 0.5)
    outer = 1.0 / np.cos(np.pi / _ROUND)
    rings = [_ring(outer * np.cos(a), outer * np.sin(a)) for a in latitudes]
    return np.vstack([*rings, [[0.0, 0.0, outer], [0.0, 0.0, -outer]]])
