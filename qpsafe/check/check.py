"""`check_path`: all that can be said about a program before anything moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.check.gaps import Gap, smallest_gap
from qpsafe.check.joints import JointMargin, joint_margins
from qpsafe.check.path import NominalPath, nominal_path
from qpsafe.check.sight import Sighting, sightings
from qpsafe.check.singular import SINGULAR, NearSingular, nearest_singular, smallest_values
from qpsafe.errors import ConfigurationError
from qpsafe.geometry.measure import pairs_of
from qpsafe.geometry.solids import Solids
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.skin.spots import SpotArray, load_spots
from qpsafe.tasks.program import Program
from qpsafe.tasks.trajectory import FixedPose, Trajectory

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.hulls import Obstacle

Array = NDArray[np.float64]

#: A path that comes nearer than that to something that stands in the cell is refused [m]. The third experiment's tool
#: works 9 mm above a plate.
CLEARANCE = 0.004


class PathCheck(NamedTuple):
    """What was found; times are the program's, places the world's.

    Attributes:
        robot: The robot.
        path: The nominal path, as far as it goes.
        duration: Of the program [s].
        clearance: That was asked for [m].
        d_min: That was asked for [m].
        known: Names of what stands in the cell.
        joints: Margins of the joints.
        singular: The pose nearest to a singular one.
        singular_values: Smallest singular value at every moment, (N,).
        furniture: Smallest distance to the cell; None if there is nothing, or nothing to measure from.
        furniture_distances: That of every moment, (N,) [m].
        own: Smallest distance of the robot to itself; None if it has no parts that could meet.
        own_distances: That of every moment, (N,) [m].
        sightings: Spots that see the cell nearer than d_min; None without spots.
        has_hulls: Whether the robot's model has collision geometry.
    """

    robot: Robot
    path: NominalPath
    duration: float
    clearance: float
    d_min: float
    known: tuple[str, ...]
    joints: tuple[JointMargin, ...]
    singular: NearSingular | None
    singular_values: Array
    furniture: Gap | None
    furniture_distances: Array
    own: Gap | None
    own_distances: Array
    sightings: tuple[Sighting, ...] | None
    has_hulls: bool

    @property
    def kept(self) -> dict[str, bool | None]:
        """Whether each thing is as it should be; None where there is nothing to check."""
        found = bool(len(self.path.times))
        furniture: bool | None = None
        if self.known and found:  # what cannot be measured is not taken for free
            furniture = self.furniture is not None and self.furniture.distance >= self.clearance
        return {
            "reach": not self.path.trouble,
            "joints": all(joint.good for joint in self.joints) if found else None,
            "singular": self.singular.value >= SINGULAR if self.singular else None,
            "furniture": furniture,
            "self": self.own.distance > 0.0 if self.own else None,
            "sensors": not self.sightings if self.sightings is not None and self.known and found else None,
        }

    @property
    def good(self) -> bool:
        """Whether the program can be run as it is planned."""
        return False not in self.kept.values()


def check_path(
    robot: Robot,
    reference: Trajectory,
    *,
    frame: str | None = None,
    known: Sequence[Obstacle] = (),
    spots: SpotArray | None = None,
    sensors: bool = True,
    rules: SensingRules | None = None,
    clearance: float = CLEARANCE,
    dt: float = 0.004,
) -> PathCheck:
    """Follow a program as if nobody were there, from the pose of its start that is nearest to the robot's home.

    The way to the start is not looked at, nor what tools carry, and of a cycle one round.

    Args:
        robot: The robot.
        reference: What its frame is to follow: a `Program`, or a `FixedPose` that it is to keep.
        frame: Which frame; by default the program's, else the tip of the first tool.
        known: What stands in the cell.
        spots: The distance sensors; by default the robot's own, if it has any.
        sensors: Whether they are in use.
        rules: For d_min; the controller's by default.
        clearance: What stands in the cell is to be this far away at least [m].
        dt: Tick [s].

    Raises:
        ConfigurationError: A frame that there is not, a clearance below zero, a reference that has no end.
        RobotFileError: The robot's collision geometry or its sensors cannot be read.
    """
    if not isinstance(reference, Program | FixedPose):
        raise ConfigurationError("check_path", "reference", reference, "a Program or a FixedPose")
    if not 0.0 <= clearance < np.inf:
        raise ConfigurationError("check_path", "clearance", clearance, "a finite distance >= 0 [m]")
    program = reference if isinstance(reference, Program) else None
    frame = frame or (program.frame if program else "") or robot.tool_frames[0]
    robot.frame_id(frame)  # raises
    duration = program.duration if program else 0.0
    spots = None if not sensors else load_spots(robot) if spots is None else spots
    d_min = (SensingRules() if rules is None else rules).d_min
    path = nominal_path(robot, frame, reference, duration, dt)
    solids = Solids.of(robot, known)
    # all pairs: what is in an obstacle already at home is not left out here
    obstacles = range(len(solids.names) - len(known), len(solids.names))
    furniture = smallest_gap(robot, path, solids, pairs_of([(i, j) for i in solids.robot.tolist() for j in obstacles]))
    own, values = smallest_gap(robot, path, solids, solids.own), smallest_values(path)
    return PathCheck(
        robot=robot,
        path=path,
        duration=duration,
        clearance=clearance,
        d_min=d_min,
        known=tuple(thing.name for thing in known),
        joints=joint_margins(robot, path),
        singular=nearest_singular(path, robot.joint_names, values),
        singular_values=values,
        furniture=furniture[0],
        furniture_distances=furniture[1],
        own=own[0],
        own_distances=own[1],
        sightings=None if spots is None else sightings(robot, path, spots, known, d_min),
        has_hulls=len(solids.names) > len(known),
    )
