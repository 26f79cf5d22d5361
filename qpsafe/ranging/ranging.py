"""The sensors of many zones of one controller: images of any time in, every tick the points that count out."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.ranging.candidates_kernel import WIDTH, choose, place_all, renew
from qpsafe.ranging.configurations import Configurations
from qpsafe.ranging.judge import Judge, Usable
from qpsafe.ranging.ranged import PERSON, Ranged
from qpsafe.ranging.reduce import Reducer
from qpsafe.ranging.rules import RangeRules
from qpsafe.ranging.sensor import WORLD, RangeImage, RangeSensor
from qpsafe.ranging.watch import SensorWatch
from qpsafe.sensing.body import body_hull_set, fixed_to
from qpsafe.sensing.detection import BadInput
from qpsafe.sensing.health import CAPPED, CLEAR, STOPPED
from qpsafe.sensing.hulls import HullSet, Obstacle
from qpsafe.sensing.rules import SensingRules

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState

Array = NDArray[np.float64]

#: How far ahead the gate looks at most: braking takes no longer [s].
AHEAD = 0.5


class RangeSensing(Fixed):
    """Takes images as they come, and tells every tick what of them counts.

    Args:
        robot: The robot.
        sensors: Whose images will come.
        sensing: Times and tolerances, shared with spots.
        rules: Numbers for images.
        known: Known obstacles of the surroundings.
        carried: What tools may carry, by frame.
        others: How many other sensors, spots, the robot has: a share of all may fail.

    Raises:
        ConfigurationError: No sensors, two of one name, or one that does not fit the robot.
    """

    fixed = frozenset(("sensors", "rules", "sensing"))

    def __init__(
        self, robot: Robot, sensors: Sequence[RangeSensor], sensing: SensingRules | None = None,
        rules: RangeRules | None = None, known: Sequence[Obstacle] = (),
        carried: Mapping[str, Sequence[Obstacle]] | None = None, others: int = 0,
    ) -> None:  # fmt: skip
        self.sensors = checked_sensors(sensors, robot)
        self.sensing = SensingRules() if sensing is None else sensing
        self.rules = RangeRules() if rules is None else rules
        hulls = HullSet([(0, thing.name, thing.vertices) for thing in known])
        if self.sensing.self_detection:
            hulls = hulls + body_hull_set(robot)
        for frame, things in ({} if carried is None else carried).items():
            hulls = hulls + HullSet([fixed_to(robot, frame, thing) for thing in things])
        self._robot, count, links = robot, len(self.sensors), len(robot.wire_frames)
        self._index = {sensor.name: i for i, sensor in enumerate(self.sensors)}
        self._judges = [Judge(sensor) for sensor in self.sensors]
        self._watches = [SensorWatch(sensor, self.rules, self.sensing) for sensor in self.sensors]
        self._reducers = [Reducer(sensor, self.rules, self.sensing, hulls, links) for sensor in self.sensors]
        self._mounts = [
            (0, sensor.pose) if sensor.mount == WORLD else _mounted(robot, sensor) for sensor in self.sensors
        ]
        room = 2 * links * self.rules.each
        self._store, self._counts = np.zeros((count, room, WIDTH)), np.zeros(count, dtype=np.int64)
        self._carriers = np.array([-1 if sensor.link is None else sensor.link for sensor in self.sensors])
        self._patience = np.array([sensor.max_age for sensor in self.sensors], dtype=np.float64)
        self._numbers = np.array([
            0.0, self.sensing.hold_time, self.sensing.approach_speed, self.sensing.d_min, PERSON, AHEAD,
        ])  # fmt: skip
        total = count * room
        self._placed = np.empty((total, 3)), np.empty(total, dtype=np.int64), np.empty((total, 3))
        self._who, self._near, self._leads = np.empty(total, dtype=np.int64), np.empty((total, 3)), np.empty(total)
        self._marks, self._chosen = np.empty(total, dtype=np.int64), np.empty(total, dtype=np.int64)
        self._still = np.zeros((links * self.rules.each, 3))
        self._past = Configurations(robot.nq)
        self._most = int(np.floor(self.sensing.dead_share * (count + others) + 1e-9))
        self._waiting: deque[Any] = deque()
        self._now = 0.0
        self.unseen: tuple[str, ...] = ()
        self.stopped = False

    @property
    def room(self) -> int:
        """How many points may count in a tick, at most."""
        return len(self._who)

    @property
    def severity(self) -> str:
        """`clear`, `capped` or `stopped`, until acknowledged."""
        return STOPPED if self.stopped else CAPPED if any(watch.dead for watch in self._watches) else CLEAR

    def reset(self) -> None:
        """Forget everything."""
        for watch in self._watches:
            watch.reset()
        self._counts[:] = 0
        self._past.reset()
        self._waiting.clear()
        self.unseen, self.stopped = (), False

    def acknowledge(self) -> None:
        """A person has looked: sensors that see again are trusted again, a stop they caused is lifted."""
        for watch in self._watches:
            watch.acknowledge(self._now)
        self.stopped = sum(watch.dead for watch in self._watches) > self._most

    def update(
        self, images: Any, now: float, state: RobotState, field: Any, qd: Array, person: float = PERSON
    ) -> Ranged:
        """One tick.

        Args:
            images: That came since the last one; whatever a user gave.
            now: Present time on the clock of their stamps [s].
            state: The robot as measured now.
            field: Danger field, by which points are chosen.
            qd: Measured joint velocity (n,) [rad/s].
            person: How fast people come [m/s].

        Raises:
            BadInput: Too many sensors do not see.
        """
        self._now = now
        self._past.take(now, state.q)
        wire = state.wire(qd)
        notes = self._take_all(images, now, wire)
        notes += self._look(now)
        self._numbers[0], self._numbers[4] = now, person
        total = place_all(
            self._store, self._counts, self._carriers, self._patience, self._numbers, wire.starts, wire.ends,
            *self._placed, self._who, self._near, self._leads,
        )  # fmt: skip
        if not total:
            return Ranged(_NONE, _NO_LINKS, _NONE, _NONE, _NO_LEADS, tuple(notes))
        points, links, velocities = (array[:total] for array in self._placed)
        if not self.sensing.velocities:
            velocities[:] = 0.0
        danger, _ = field.evaluate(points, wire, velocities)
        count = choose(
            points, links, self._who[:total], danger, self.rules.most, self.rules.apart, self._marks, self._chosen
        )
        chosen = self._chosen[:count]
        return Ranged(
            points[chosen], links[chosen], velocities[chosen], self._near[:total].copy(), self._leads[:total].copy(),
            tuple(notes),
        )  # fmt: skip

    def _take_all(self, images: Any, now: float, wire: Any) -> list[str]:
        """Take the images that came, as many as there is time for; what is wrong, in words."""
        notes: list[str] = []
        if isinstance(images, RangeImage):
            images = (images,)
        if not isinstance(images, Iterable):
            return [f"images are no list of RangeImages but {type(images).__name__}"]
        self._waiting.extend(images)
        budget = self.rules.budget
        while self._waiting:
            image = self._waiting[0]
            who = self._index.get(image.sensor.name) if _is_image(image) else None
            if who is None:
                what = (
                    f"of {image.sensor.name!r}, which is not among range_sensors"
                    if _is_image(image)
                    else "no RangeImage"
                )
                notes.append(f"an image is {what}")
                self._waiting.popleft()
                continue
            budget -= len(self.sensors[who])
            if budget < 0 and budget + len(self.sensors[who]) < self.rules.budget:
                break  # the rest waits for the next tick
            self._waiting.popleft()
            try:
                wrong = self._take(who, image, now, wire)
            except BadInput as problem:
                wrong = str(problem)
            if wrong and wrong != "late":
                notes.append(f"image of {self.sensors[who].name} unusable: {wrong}")
        while len(self._waiting) > 4 * len(self.sensors):  # they come faster than they can be taken
            self._waiting.popleft()
            notes.append("images come faster than they can be taken: the oldest are left out")
        return list(dict.fromkeys(notes))

    def _take(self, who: int, image: RangeImage, now: float, wire: Any) -> str:
        watch, given = self._watches[who], self._judges[who](image)
        wrong = watch.too_old(given.stamp, now)
        if wrong:
            return wrong
        then = self._robot.at(self._past.at(given.stamp))
        poses, (body, place) = then.body_poses(), self._mounts[who]
        pose = poses[body] @ place
        count, shown = self._reducers[who](given, pose, poses, wire)
        # what has to move for a frozen image to be told: the sensor, or what a fixed one may see of the robot
        wrong = watch.judged(given, shown, poses if self.sensors[who].mount == WORLD else pose)
        if not wrong:
            self._renew(who, given, count)
        return wrong

    def _renew(self, who: int, image: Usable, count: int) -> None:
        kept = self._reducers[who].kept
        self._counts[who] = renew(
            self._store[who], self._counts[who], kept, count, self._still, image.stamp, self.sensing.hold_time,
            2.0 * self.rules.apart,
        )  # fmt: skip

    def _look(self, now: float) -> list[str]:
        """Which sensors do not see, in words.

        Raises:
            BadInput: Too many.
        """
        kinds: dict[str, list[str]] = {}
        unseen = []
        for sensor, watch in zip(self.sensors, self._watches, strict=True):
            what = watch.look(now)
            if what:
                kinds.setdefault(what, []).append(sensor.name)
                unseen.append(sensor.name)
        self.unseen = tuple(unseen)
        if not unseen:
            return []
        self.stopped |= sum(watch.dead for watch in self._watches) > self._most
        notes = [f"range sensors {what}, unseen what is before them: {', '.join(who)}" for what, who in kinds.items()]
        if self.stopped or len(unseen) > self._most:
            more = "stopped until acknowledged" if self.stopped else "stopped until they see again"
            raise BadInput("; ".join((f"more than {self._most} range sensors do not see: {more}", *notes)))
        return notes


def checked_sensors(sensors: Any, robot: Robot) -> tuple[RangeSensor, ...]:
    """Sensors that a robot's cell can hold.

    Raises:
        ConfigurationError: None, no sensors, two of one name, or one that does not fit the robot.
    """
    where, expected = "SafetyController", "RangeSensors, each with a name of its own"
    if isinstance(sensors, RangeSensor | str) or not isinstance(sensors, Iterable):
        raise ConfigurationError(where, "range_sensors", sensors, "a list of " + expected)
    found: dict[str, RangeSensor] = {}
    for sensor in sensors:
        if not isinstance(sensor, RangeSensor) or sensor.name in found:
            raise ConfigurationError(where, "range_sensors", sensor, expected)
        sensor.check(robot)
        found[sensor.name] = sensor
    if not found:
        raise ConfigurationError(where, "range_sensors", sensors, "at least one RangeSensor")
    return tuple(found.values())


def _mounted(robot: Robot, sensor: RangeSensor) -> tuple[int, Array]:
    """The body that carries a sensor, and its pose on it."""
    body, place = robot.mounting(sensor.mount)
    return body, place @ sensor.pose


def _is_image(image: Any) -> bool:
    return isinstance(image, RangeImage) and isinstance(image.sensor, RangeSensor)


_NONE, _NO_LINKS, _NO_LEADS = np.empty((0, 3)), np.empty(0, dtype=np.int64), np.empty(0)
