"""The distributed distance sensor of sections II-B and V-B: from readings of one tick to the points that count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.sensing.body import surrounding_hulls
from qpsafe.sensing.detection import BadInput, as_floats
from qpsafe.sensing.health import HEALTHY, WORDS, SpotHealth
from qpsafe.sensing.hold import PointHold
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.readings import take_readings
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.skin.spots import SpotArray
from qpsafe.sensing.velocity import ApproachVelocity
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.robot.wire import Wire

Array = NDArray[np.float64]


class Detected(NamedTuple):
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


class Tables(NamedTuple):
    """What `take_readings` needs of spots, hulls and rules, in its order; does not change."""

    bodies: NDArray[np.int64]
    links: NDArray[np.int64]
    rays: Array
    ranges: Array
    hull_bodies: NDArray[np.int64]
    first: NDArray[np.int64]
    planes: Array
    balls: Array
    numbers: Array
    ticks: NDArray[np.int64]


def check_surroundings(
    robot: Robot, rules: object, known: Sequence[Obstacle], carried: Mapping[str, Sequence[Obstacle]] | None
) -> None:
    """Refuse what a `SafetyController` cannot sense with, by name.

    Args:
        robot: Whose surroundings these are.
        rules: As given.
        known: As given.
        carried: As given.

    Raises:
        ConfigurationError: Not rules, not an obstacle, or no frame of the robot.
    """
    if not isinstance(rules, SensingRules):
        raise ConfigurationError("SafetyController", "sensing", rules, "SensingRules")
    if not (carried is None or isinstance(carried, Mapping)):
        expected = 'what each frame carries, e.g. {"tcp": [Obstacle.box(...)]}'
        raise ConfigurationError("SafetyController", "carried", carried, expected)
    frames = {} if carried is None else carried
    for frame in frames:
        if frame not in robot.frame_names:
            raise ConfigurationError("SafetyController", "carried", frame, "one of " + ", ".join(robot.frame_names))
    for key, things in (("known", known), *((f"carried[{frame!r}]", things) for frame, things in frames.items())):
        if not isinstance(things, Sequence) or isinstance(things, str):
            raise ConfigurationError("SafetyController", key, things, "a list of Obstacles")
        for i, thing in enumerate(things):
            if not isinstance(thing, Obstacle):
                raise ConfigurationError("SafetyController", f"{key}[{i}]", thing, "an Obstacle, e.g. Obstacle.box")


class DistanceSensing(Fixed):
    """Readings of all spots in, points that count out; one call a tick.

    Args:
        robot: The robot.
        spots: Its distance sensors.
        dt: Tick [s].
        rules: What counts, and what a sick sensor does.
        known: Known obstacles of the surroundings.
        carried: What tools may carry, keyed by the frame it is fixed to, in that frame's axes: part of the robot.

    Raises:
        ConfigurationError: The spots do not fit the robot, or something known is no `Obstacle`.
        RobotFileError: The robot's collision geometry cannot be read.
    """

    fixed = frozenset(("rules", "spots", "health", "tables", "memory"))

    def __init__(
        self,
        robot: Robot,
        spots: SpotArray,
        dt: float,
        rules: SensingRules | None = None,
        known: Sequence[Obstacle] = (),
        carried: Mapping[str, Sequence[Obstacle]] | None = None,
    ) -> None:
        self.rules = rules = SensingRules() if rules is None else rules
        check_surroundings(robot, rules, known, carried)
        spots.check(robot)
        self.spots = spots
        hulls = surrounding_hulls(robot, rules.self_detection, known, carried)
        count = len(spots)
        self.health = SpotHealth(count, rules, dt)
        self._hold = PointHold(count, rules, dt)
        self._velocity = ApproachVelocity(count, dt)
        bodies, rays = spots.mounting(robot)
        links = np.array(spots.links, dtype=np.int64)
        cone = np.tan(0.5 * spots.field_of_view)
        ranges = np.ascontiguousarray(np.column_stack((spots.range_max, cone)))
        self.fresh = np.zeros(count)  # ages of readings that come without
        self.tables = Tables(bodies, links, rays, ranges, *hulls.tables, *self._settings(dt))
        for table in self.tables:
            table.flags.writeable = False
        self.memory = (
            self.health.counts, self.health.seen, self.health.dead,
            self._hold.held, self._hold.age, self._velocity.track,
        )  # fmt: skip

    def _settings(self, dt: float) -> tuple[Array, NDArray[np.int64]]:
        """Numbers and ticks as `take_readings` wants them."""
        rules, health, hold, filter_ = self.rules, self.health, self._hold, self._velocity
        numbers = (
            dt, rules.d_min, rules.tolerance, rules.max_age, rules.stuck_motion,
            hold.step, rules.jump, filter_.alpha, filter_.beta, filter_.fastest,
            rules.clock_error,
        )  # fmt: skip
        return np.array(numbers), np.array((*health.ticks, hold.ticks, rules.velocities))

    def reset(self) -> None:
        """Forget everything: held points, sick and dead spots."""
        self.health.reset()
        self._hold.reset()
        self._velocity.reset()

    def acknowledge(self) -> None:
        """A person has looked: spots that work again count as working, severity may fall."""
        self.health.acknowledge()

    def update(self, state: RobotState, wire: Wire, distances: Array, ages: Array | None = None) -> Detected:
        """Take one tick's readings.

        Args:
            state: Robot at the measured joint position.
            wire: Its wire.
            distances: One reading a spot (k,) [m], any numbers: +inf where nothing is in sight (REP 117).
            ages: How old each reading is (k,) [s]; None for fresh ones.
        """
        k = len(self.fresh)
        points, links, velocities = np.empty((k, 3)), np.empty(k, dtype=np.int64), np.empty((k, 3))
        count, dead, out = take_readings(
            distances, self.fresh if ages is None else ages, state.memory, wire.starts, wire.ends,
            *self.tables, *self.memory, points, links, velocities,
        )  # fmt: skip
        severity, too_many, notes = self.take(dead, out)
        moving = velocities[:count] if self.rules.velocities else None
        return Detected(points[:count], links[:count], moving, severity, too_many, notes)

    def as_ages(self, ages: ArrayLike | None) -> Array:
        """Ages of all readings (k,) [s]; zeros for None.

        Raises:
            BadInput: Neither one number nor one a spot.
        """
        if ages is None:
            return self.fresh
        ages, shape = as_floats("ages", ages), self.fresh.shape
        if ages.shape not in ((), shape):
            raise BadInput(f"ages have shape {ages.shape}, expected {shape} or one number")
        return np.broadcast_to(ages, shape) if ages.shape == () else ages

    def take(self, dead: int, out: int) -> tuple[str, bool, tuple[str, ...]]:
        """Take how many spots are dead, how many dead or unusable: severity, too_many and notes as in `Detected`."""
        health = self.health
        health.take(dead, out)
        return health.severity, health.too_many, self._notes() if out or health.stopped else ()

    @property
    def unseen(self) -> tuple[str, ...]:
        """Names of the spots whose sector nobody sees: unusable in the last tick, or dead."""
        return tuple([self.spots.names[i] for i in self.health.out_of_order]) if self.health.any_out else ()

    @property
    def counted(self) -> Array:
        """Distance at which each spot saw the point of it that counts now, (k,) [m]; +inf where none counts."""
        return self._hold.held[:, 0].copy()

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
            notes.insert(0, f"more than {health.most} of {counted(len(names), 'spot')} are out of order: {more}")
        return tuple(notes)
