"""The distributed distance sensor of sections II-B and V-B: from readings of one tick to the points that count."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sensing.body import body_hull_set
from qpsafe.sensing.health import HEALTHY, WORDS, SpotHealth
from qpsafe.sensing.hold import PointHold
from qpsafe.sensing.hulls import HullSet, Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.spots import SpotArray, detected_points, rays_in_world
from qpsafe.sensing.velocity import ApproachVelocity

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.robot.wire import Wire

Array = NDArray[np.float64]


class Seen(NamedTuple):
    """What the spots tell in one tick.

    Attributes:
        points: Points that count, (p, 3), world frame [m].
        links: Wire link of each point, (p,), from 0.
        velocities: Of the points (p, 3) [m/s], or None where they are taken as standing still.
        severity: `clear`, `capped` (dead spots, limited speed) or `stopped`.
        too_many: Whether too many spots are unusable for the robot to move on.
        notes: What is wrong, in words.
    """

    points: Array
    links: NDArray[np.int64]
    velocities: Array | None
    severity: str
    too_many: bool
    notes: tuple[str, ...]


class DistanceSensing:
    """Readings of all spots in, points that count out; one call a tick.

    Args:
        robot: The robot.
        spots: Its distance sensors.
        dt: Tick [s].
        rules: What counts, and what a sick sensor does.
        known: Known obstacles of the surroundings.

    Raises:
        ConfigurationError: The spots do not fit the robot, or an obstacle is none.
        RobotFileError: The robot's collision geometry cannot be read.
    """

    def __init__(
        self,
        robot: Robot,
        spots: SpotArray,
        dt: float,
        rules: SensingRules | None = None,
        known: Sequence[Obstacle] = (),
    ) -> None:
        self.rules = rules = SensingRules() if rules is None else rules
        if not isinstance(rules, SensingRules):
            raise ConfigurationError("SafetyController", "sensing", rules, "SensingRules")
        for i, obstacle in enumerate(known):
            if not isinstance(obstacle, Obstacle):
                raise ConfigurationError("SafetyController", f"known[{i}]", obstacle, "an Obstacle, e.g. Obstacle.box")
        spots.check(robot)
        self.spots = spots
        self._bodies, self._rays = spots.mounting(robot)
        # body 0 is the world: known obstacles stand in it
        self._known = HullSet([(0, obstacle.name, obstacle.vertices) for obstacle in known])
        if rules.self_detection:
            self._known = self._known + body_hull_set(robot)
        self._cone = np.tan(0.5 * spots.field_of_view)
        self._fresh_age = np.zeros(len(spots))
        self.health = SpotHealth(len(spots), rules, dt)
        self._hold = PointHold(len(spots), rules, dt, spots.range_max)
        self._velocity = ApproachVelocity(len(spots), dt) if rules.velocities else None

    def reset(self) -> None:
        """Forget everything: held points, sick and dead spots."""
        self.health.reset()
        self._hold.reset()
        if self._velocity is not None:
            self._velocity.reset()

    def acknowledge(self) -> None:
        """A person has looked: spots that work again count as working, severity may fall."""
        self.health.acknowledge()

    def update(self, state: RobotState, wire: Wire, distances: Array, ages: Array | None = None) -> Seen:
        """Take one tick's readings.

        Args:
            state: Robot at the measured joint position.
            wire: Its wire.
            distances: One reading a spot (k,) [m], any numbers: +inf where nothing is in sight (REP 117).
            ages: How old each reading is (k,) [s]; None for fresh ones.
        """
        poses = state.body_poses()
        origins, directions = rays_in_world(poses, self._bodies, self._rays)
        health = self.health
        health.update(distances, self._fresh_age if ages is None else ages, origins, directions)

        # (7), for what is usable and within range; elsewhere the point is the spot itself and never counts
        usable = health.codes == HEALTHY
        hit = usable & (distances <= self.spots.range_max)
        reach = np.where(hit, distances, 0.0)
        points = detected_points(origins, directions, reach)
        # known obstacles and the robot itself do not count, but for what is nearer than d_min
        tolerance = self.rules.tolerance + self._cone * reach
        unknown = self._known.find(points, tolerance, poses) < 0
        counts = hit & (unknown | (reach < self.rules.d_min))

        reading = np.where(usable, np.where(hit, reach, np.inf), np.nan)
        present = self._hold.update(reading, counts, points, origins, wire)
        velocities = None
        if self._velocity is not None:
            fresh = present & (self._hold.age == 0)
            velocities = self._velocity.update(reading, fresh, origins, directions)[present]
        points, links = self._hold.points[present], self.spots.links[present]
        return Seen(points, links, velocities, health.severity, health.too_many, self._notes())

    @property
    def unseen(self) -> tuple[str, ...]:
        """Names of the spots whose sector nobody sees: unusable in the last tick, or dead."""
        return tuple(self.spots.names[i] for i in self.health.out_of_order)

    @property
    def counted(self) -> Array:
        """Distance at which each spot saw the point of it that counts now, (k,) [m]; +inf where none counts."""
        return self._hold.seen.copy()

    def _notes(self) -> tuple[str, ...]:
        health, names = self.health, self.spots.names
        kinds: dict[str, list[str]] = {}
        for i in health.out_of_order:
            what = WORDS[health.codes[i]]
            if health.dead[i]:
                what = "dead until acknowledged" if health.codes[i] == HEALTHY else f"dead ({what})"
            kinds.setdefault(what, []).append(names[i])
        notes = [f"spots {what}, unseen what is before them: {', '.join(who)}" for what, who in kinds.items()]
        if health.too_many:
            more = "stopped until acknowledged" if health.stopped else "stopped until they see again"
            notes.insert(0, f"more than {health.most} of {len(names)} spots are out of order: {more}")
        return tuple(notes)
