"""How near robot and people came in a run: contact or not, and how fast the robot was then."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.sim.engine.bodies import Bodies
from qpsafe.sim.engine.tracks import people_of
from qpsafe.sim.engine.world import World
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.recording.log import RunLog
from qpsafe.sim.world.contact_point import contact_point
from qpsafe.sim.world.distance import TrueDistances

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.replay.settings import Experiment

MOVING = 1e-3  # below this the robot counts as standing [m/s]
NEAR = 2.0  # farther away distances of links are not measured [m]


@dataclass(frozen=True)
class Encounter:
    """The nearest that robot and people, boards included, came to each other.

    Attributes:
        distance: Smallest true distance, negative where they overlap [m].
        time: When [s].
        contact: When they first touched [s]; None if never.
        robot_speed: Of the robot's fastest point at that moment, at the smallest distance if they never touched [m/s].
        closing_speed: How fast the distance shrank at that moment [m/s].
        fastest_in_contact: Of the robot's fastest point while they touched [m/s]; None if never.
        moving_contact: How long they touched while the robot moved faster than 1 mm/s [s].
        danger: Largest CDF_n.
        towards_speed: Of the robot's contact point towards the person or board one tick before contact, negative where
            it goes away [m/s]; None if they never touched.
    """

    distance: float
    time: float
    contact: float | None
    robot_speed: float
    closing_speed: float
    fastest_in_contact: float | None
    moving_contact: float
    danger: float
    towards_speed: float | None

    def sentence(self) -> str:
        """The encounter in words."""
        if self.contact is None:
            return (
                f"no contact; nearest {1e3 * self.distance:.0f} mm at {self.time:.2f} s, "
                f"robot at {self.robot_speed:.3f} m/s then"
            )
        return (
            f"CONTACT at {self.contact:.2f} s, robot at {self.robot_speed:.3f} m/s, closing at "
            f"{self.closing_speed:.2f} m/s; {self.moving_contact:.2f} s of contact with the robot moving, "
            f"up to {self.fastest_in_contact or 0.0:.3f} m/s"
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def encounter(log: RunLog, experiment: Experiment) -> Encounter:
    """Measure a run; people and boards are not pushed away by the robot, nor it by them.

    Args:
        log: The run.
        experiment: Of which it is.
    """
    robot = experiment.robot
    gap = np.minimum(log.person_distance, log.board_distance)
    nearest = int(gap.argmin())
    touching = np.flatnonzero(gap <= 0.0)
    speeds = [fastest_point(robot, log.q[k], log.qd[k]) for k in touching]
    first = int(touching[0]) if len(touching) else nearest
    return Encounter(
        distance=float(gap[nearest]),
        time=float(log.time[nearest]),
        contact=float(log.time[first]) if len(touching) else None,
        robot_speed=fastest_point(robot, log.q[first], log.qd[first]),
        closing_speed=float(gap[max(first - 1, 0)] - gap[first]) / log.dt,
        fastest_in_contact=max(speeds) if speeds else None,
        moving_contact=log.dt * sum(speed > MOVING for speed in speeds),
        danger=float(np.nanmax(log.cdf_n)),
        towards_speed=_towards(log, experiment, max(first - 1, 0)) if len(touching) else None,
    )


def to_moving_links(log: RunLog, experiment: Experiment) -> float:
    """Smallest true distance of the links that move, the base left out: it can get away from nobody [m].

    Args:
        log: The run.
        experiment: Of which it is.
    """
    scene, robot = experiment.scene, experiment.robot
    bodies, poses, least = Bodies(World.of(scene), robot), _ahead(log, experiment), np.inf
    data = scene.make_data(log.q[0])
    for k in range(len(log.time)):
        scene.place_people(data, poses(k))
        near = bodies.to_people(robot.at(log.q[k]), people_of(scene, data), NEAR)
        least = min(least, float(near.distance.min(initial=np.inf)))
    return least


def _ahead(log: RunLog, experiment: Experiment) -> PosesAhead:
    people = experiment.people if isinstance(experiment, PickPlaceExperiment) else experiment.walk.people
    return PosesAhead(people, log.dt)


def _towards(log: RunLog, experiment: Experiment, k: int) -> float:
    """Speed of the robot's nearest point towards whom it is nearest to, at a tick [m/s].

    Where everybody was then follows from the experiment; the log has no room for it.
    """
    scene = experiment.scene
    data = scene.make_data(log.q[k])
    scene.place_people(data, _ahead(log, experiment)(k))
    near = min(TrueDistances(scene).measure(data), key=lambda found: found.distance)
    state, pair = experiment.robot.at(log.q[k]), (near.on_robot, near.on_other)
    return contact_point(state, log.qd[k], near.body, pair, near.distance).towards


def fastest_point(robot: Robot, q: np.ndarray, qd: np.ndarray) -> float:
    """Speed of the fastest end of the robot's wire model [m/s].

    Args:
        robot: The robot.
        q: (n,) [rad].
        qd: (n,) [rad/s].
    """
    wire = robot.wire(q, qd)
    return float(np.linalg.norm(np.vstack((wire.start_velocities, wire.end_velocities)), axis=1).max())
