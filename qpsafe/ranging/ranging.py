"""The sensors of many zones of one controller: images of any time in, every tick the points that count out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.field import DangerField
from qpsafe.ranging.checks import check_clock, checked_sensors, mounting
from qpsafe.ranging.configurations import Configurations
from qpsafe.ranging.inbox import Inbox
from qpsafe.ranging.judge import Judge
from qpsafe.ranging.ranged import COLUMNS, PERSON, Ranged
from qpsafe.ranging.reduction.candidates_kernel import WIDTH, choose, place_all, renew
from qpsafe.ranging.reduction.reduce import Reducer
from qpsafe.ranging.rules import OCCUPIED, RangeRules
from qpsafe.ranging.sensor import WORLD, RangeImage, RangeSensor
from qpsafe.ranging.tracking.prediction import Foresight
from qpsafe.ranging.tracking.velocities import Velocities
from qpsafe.ranging.unseen import Together
from qpsafe.ranging.watch import LATE
from qpsafe.ranging.watches import Watches
from qpsafe.robot.state import RobotState
from qpsafe.robot.wire import Wire
from qpsafe.sensing.body import surrounding_hulls
from qpsafe.sensing.detection import BadInput, reals
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: How far ahead the gate looks at most: braking takes no longer [s].
AHEAD = 0.5


class RangeSensing:
    """Takes images as they come, and tells every tick what of them counts.

    Args:
        robot: The robot.
        sensors: Whose images will come.
        sensing: Times and tolerances, shared with spots.
        rules: Numbers for images.
        known: Known obstacles of the surroundings.
        carried: What tools may carry, by frame.
        others: How many other sensors, spots, the robot has: a share of all may fail.

    Attributes:
        inbox: Images that came.
        watches: Which sensors do not see.

    Raises:
        ConfigurationError: No sensors, two of one name, or one that does not fit the robot.
    """

    def __init__(
        self, robot: Robot, sensors: Sequence[RangeSensor], sensing: SensingRules | None = None,
        rules: RangeRules | None = None, known: Sequence[Obstacle] = (),
        carried: Mapping[str, Sequence[Obstacle]] | None = None, others: int = 0,
    ) -> None:  # fmt: skip
        self._sensors = checked_sensors(sensors, robot)
        self._sensing = SensingRules() if sensing is None else sensing
        self._rules = RangeRules() if rules is None else rules
        hulls = surrounding_hulls(robot, self.sensing.self_detection, known, carried)
        self._robot, count, links = robot, len(self.sensors), len(robot.wire_frames)
        self._judges = [Judge(sensor, self.rules, self.sensing.tolerance) for sensor in self.sensors]
        self._reducers = [Reducer(sensor, self.rules, self.sensing, hulls, links) for sensor in self.sensors]
        self._mounts = [mounting(robot, sensor) for sensor in self.sensors]
        room = 2 * links * self.rules.each
        self._store, self._counts = np.zeros((count, room, WIDTH)), np.zeros(count, dtype=np.int64)
        self._carriers = np.array([-1 if sensor.link is None else sensor.link for sensor in self.sensors])
        self._patience = np.array([sensor.patience for sensor in self.sensors])
        self._numbers = np.array([
            0.0, self.sensing.hold_time, self.sensing.approach_speed, self.sensing.d_min, PERSON, AHEAD,
            self.rules.acceleration, self.rules.fastest,
        ])  # fmt: skip
        total = count * room
        self._placed = np.empty((total, 3)), np.empty(total, dtype=np.int64), np.empty((total, 3))
        self._who, self._near = np.empty(total, dtype=np.int64), np.empty((total, 3))
        self._ages, self._leads = np.empty(total), np.empty(total)
        self._marks, self._field = np.empty(total, dtype=np.int64), (np.empty(total), np.zeros((total, 3)))
        self._used = np.empty((2, count, links), dtype=np.int64)
        self._tracks = [Velocities(sensor.sigma) for sensor in self.sensors] if self.rules.predict else []
        self._foresight = Foresight(total)
        self._together: Together | None = None
        if count > 1 or self.rules.unseen == OCCUPIED:
            running = self.rules.acceleration, self.rules.fastest
            self._together = Together(
                self._reducers, self.sensing.tolerance, self.rules.deviations, hulls, self.sensing.approach_speed,
                total, self._mounts, running,
            )  # fmt: skip
        self._still = np.zeros((links * self.rules.each, 3))
        self._past = Configurations(robot.nq, float(self._patience.max()))
        most = int(np.floor(self.sensing.dead_share * (count + others) + 1e-9))
        self.watches = Watches(self.sensors, self.rules, self.sensing, most)
        self.inbox = Inbox(self.sensors, self.rules.budget)
        self.reset()

    @property
    def sensors(self) -> tuple[RangeSensor, ...]:
        """Whose images are taken."""
        return self._sensors

    @property
    def rules(self) -> RangeRules:
        """Numbers for images."""
        return self._rules

    @property
    def sensing(self) -> SensingRules:
        """Times and tolerances."""
        return self._sensing

    @property
    def room(self) -> int:
        """How many points may count in a tick, at most."""
        return len(self._who)

    def reset(self) -> None:
        """Forget everything."""
        self.watches.reset()
        for tracks in self._tracks:
            tracks.reset()
        self._counts[:] = 0
        if self._together is not None:
            self._together.reset()
        self._hidden_places, self._looked, self._hidden_at = np.empty((0, 3)), True, -inf
        self._past.reset()
        self.inbox.reset()
        self._now = -inf

    def acknowledge(self) -> None:
        """A person has looked: sensors that see again are trusted again, a stop they caused is lifted."""
        self.watches.acknowledge(self._now)

    def update(
        self, images: Any, now: float, q: Array, poses: Array, wire: Wire, field: Any, person: float = PERSON
    ) -> Ranged:
        """One tick.

        Args:
            images: That came since the last one; whatever a user gave.
            now: Present time on the clock of their stamps [s].
            q: The robot as measured now (n,) [rad].
            poses: Of its bodies (b, 4, 4).
            wire: Its wire.
            field: Danger field, by which points are chosen.
            person: How fast people come [m/s].

        Raises:
            BadInput: Too many sensors do not see; or the clock cannot tell how old anything is.
        """
        now = self._now = check_clock(now, self._now)
        self._past.take(now, q)
        self._numbers[0], self._numbers[4] = now, person
        notes = self._take_all(images, now, poses, wire)
        notes += self.watches.look(now)
        total, moving = place_all(
            self._store, self._counts, self._carriers, self._patience, self._numbers, wire.starts, wire.ends,
            *self._placed, self._who, self._near, self._ages, self._leads,
        )  # fmt: skip
        hidden = self._hidden(now, poses, wire, person)
        if not total:
            return Ranged(_NONE, _NO_LINKS, hidden.copy(), self._since(hidden), tuple(notes))
        points, links, velocities = self._placed[0][:total], self._placed[1][:total], self._placed[2][:total]
        if moving:
            points, velocities = self._ahead(points, velocities, wire, field)
        told, on = np.empty((total, COLUMNS)), np.empty(total, dtype=np.int64)
        count = choose(
            points, links, velocities, self._who[:total], *self._danger(points, velocities, wire, field),
            self.rules.most, self.rules.apart, self._marks, self._used, told, on,
        )  # fmt: skip
        if count < 0:
            raise BadInput("the danger of a seen point is not finite")
        near, leads = self._near[:total], self._leads[:total]
        if len(hidden):
            near, leads = np.concatenate((near, hidden)), np.concatenate((leads, self._since(hidden)))
        else:  # not our memory of the next tick
            near, leads = near.copy(), leads.copy()
        return Ranged(told[:count], on[:count], near, leads, tuple(notes))

    def _since(self, hidden: Array) -> Array:
        """For how long who may have stood at hidden places (p, 3) may have come since (p,) [s]."""
        return np.full(len(hidden), self._now - self._hidden_at)

    def _danger(self, points: Array, velocities: Array, wire: Wire, field: Any) -> tuple[Array, Array]:
        """Value (p,) and gradient (p, 3) of the field, eq. (5); one of another making is asked for the value only."""
        value, gradient = self._field[0][: len(points)], self._field[1][: len(points)]
        if type(field) is DangerField:
            field.fill(points, velocities, wire, value, gradient)
        else:
            found, _ = field.evaluate(points.copy(), Wire(*[part.copy() for part in wire]), velocities.copy())
            value[:] = reals("the field's value", found, value.shape)
        return value, gradient

    def _hidden(self, now: float, poses: Array, wire: Wire, person: float) -> Array:
        """Where somebody may be whom no sensor sees, by the last images (p, 3) [m]; none unless that is asked for."""
        anew = self._looked or now - self._hidden_at > AGAIN  # the robot goes on where no image comes
        if self.rules.unseen == OCCUPIED and anew and self._together is not None:
            places = self._together.unseen(wire, poses, now, person)
            self._hidden_places, self._looked, self._hidden_at = places, False, now
        return self._hidden_places

    def _ahead(self, points: Array, velocities: Array, wire: Wire, field: Any) -> tuple[Array, Array]:
        """Where points that move count, and their velocities there; at rest by a field of another making."""
        if not self.sensing.velocities or type(field) is not DangerField:
            return points, np.zeros_like(velocities)
        elapsed, weights = self._ages[: len(points)] + self.rules.horizon, (field.static, field.kinetic, field.gamma)
        return self._foresight(points, velocities, elapsed, self.sensing.d_min, wire, weights, field.floor)

    def _take_all(self, images: Any, now: float, poses: Array, wire: Wire) -> list[str]:
        """Take the images that came, as many as there is time for; what is wrong, in words."""
        if not (type(images) is tuple and not images):
            self.inbox.put(images)
        taken, notes = self.inbox.take()
        if not taken:
            return list(dict.fromkeys(notes))
        for who, image in taken:
            try:
                wrong = self._take(who, image, now, poses, wire)
            except BadInput as problem:
                wrong = str(problem)
            if wrong and wrong != LATE:
                notes.append(f"image of {self.sensors[who].name} unusable: {wrong}")
        return list(dict.fromkeys(notes))

    def _take(self, who: int, image: RangeImage, now: float, poses: Array, wire: Wire) -> str:
        watch, given = self.watches.each[who], self._judges[who](image)
        wrong = watch.too_old(given.stamp, now)
        if wrong:
            return wrong
        if given.stamp < now:
            poses = RobotState(self._robot, self._past.at(given.stamp)).body_poses()
        body, place = self._mounts[who]
        pose = poses[body] @ place
        fixed = self.sensors[who].mount == WORLD
        count, shown = self._reducers[who](given, pose, poses, wire, -1 if fixed else body)
        # what has to move for a frozen image to be told: the sensor, or what a fixed one may see of the robot
        wrong = watch.judged(given.stamp, self._reducers[who].distances, shown, poses if fixed else pose)
        if not wrong:
            self.watches.saw(who, given.stamp)
            velocities = self._still
            if self._tracks:
                points = self._reducers[who].sparse[: shown.sparse]
                velocities = self._tracks[who](given.stamp, points, None if fixed else pose)[:count]
            self._renew(who, given.stamp, count, shown.seen, velocities)
            if self._together is not None:
                self._together.take(who, given.stamp, pose, self._store, self._counts, float(self._numbers[4]))
                self._looked = True
        return wrong

    def _renew(self, who: int, stamp: float, count: int, seen: int, velocities: Array) -> None:
        kept, found = self._reducers[who].kept, self._reducers[who].found[:seen]
        self._counts[who] = renew(
            self._store[who], self._counts[who], kept, count, velocities, found, stamp, self.sensing.hold_time,
            2.0 * self.rules.apart,
        )  # fmt: skip


AGAIN = 0.1  # without any image, hidden places are looked for so often: they are around the robot, which moves [s]
_NONE, _NO_LINKS = np.empty((0, COLUMNS)), np.empty(0, dtype=np.int64)
