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
from qpsafe.ranging.ranged import PERSON, Ranged
from qpsafe.ranging.reduction.candidates_kernel import WIDTH, choose, place_all, renew
from qpsafe.ranging.reduction.reduce import Reducer
from qpsafe.ranging.rules import OCCUPIED, RangeRules
from qpsafe.ranging.sensor import WORLD, RangeImage, RangeSensor
from qpsafe.ranging.tracking.prediction import Foresight
from qpsafe.ranging.tracking.velocities import MOST, Velocities
from qpsafe.ranging.unseen import Together
from qpsafe.ranging.watch import LATE, SensorWatch
from qpsafe.robot.state import RobotState
from qpsafe.sensing.body import surrounding_hulls
from qpsafe.sensing.detection import BadInput, reals
from qpsafe.sensing.health import CAPPED, CLEAR, STOPPED
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.wire import Wire

Array = NDArray[np.float64]

#: How far ahead the gate looks at most: braking takes no longer [s].
AHEAD = 0.5
_ROUNDING = 1e-6  # of times, by far [s]


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
        self._watches = [SensorWatch(sensor, self.rules, self.sensing) for sensor in self.sensors]
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
        self._marks = np.empty(total, dtype=np.int64)
        self._chosen = np.empty((total, 3)), np.empty(total, dtype=np.int64), np.empty((total, 3))
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
        self.most = int(np.floor(self.sensing.dead_share * (count + others) + 1e-9))
        self.inbox = Inbox(self.sensors, self.rules.budget)
        self._seen = np.zeros(count)
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

    @property
    def severity(self) -> str:
        """`clear`, `capped` or `stopped`, until acknowledged."""
        dead = self._doubted and any(watch.dead for watch in self._watches)
        return STOPPED if self.stopped else CAPPED if dead else CLEAR

    def reset(self) -> None:
        """Forget everything."""
        for watch in self._watches:
            watch.reset()
        for tracks in self._tracks:
            tracks.reset()
        self._counts[:] = 0
        if self._together is not None:
            self._together.reset()
        self._hidden_places, self._looked, self._hidden_at = _NONE, True, -inf
        self._past.reset()
        self.inbox.reset()
        self.unseen: tuple[str, ...] = ()
        self.stopped = self._doubted = False
        self._now = -inf
        self._begin = True  # sensors are waited for from the next tick on
        self._until = -inf  # surely no sensor is silent before

    def acknowledge(self) -> None:
        """A person has looked: sensors that see again are trusted again, a stop they caused is lifted."""
        for watch in self._watches:
            watch.acknowledge(self._now)
        self.stopped = sum(watch.dead for watch in self._watches) > self.most

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
            BadInput: Too many sensors do not see; or the clock cannot tell how old anything is.
        """
        now = self._now = check_clock(now, self._now)
        self._past.take(now, state.q)
        wire = state.wire(qd)
        notes = self._take_all(images, now, wire)
        notes += self._look(now)
        self._numbers[0], self._numbers[4] = now, person
        total, moving = place_all(
            self._store, self._counts, self._carriers, self._patience, self._numbers, wire.starts, wire.ends,
            *self._placed, self._who, self._near, self._ages, self._leads,
        )  # fmt: skip
        hidden = self._hidden(now, state, wire)
        since = np.full(len(hidden), now - self._hidden_at)  # who may have stood there may have come since
        if not total:
            return Ranged(_NONE, _NO_LINKS, _NONE, hidden, since, tuple(notes))
        points, links, velocities = self._placed[0][:total], self._placed[1][:total], self._placed[2][:total]
        if moving:
            points, velocities = self._ahead(points, velocities, wire, field)
        danger, _ = field.evaluate(points, wire, velocities)
        danger = reals("the field's value", danger, (total,))
        count = choose(
            points, links, velocities, self._who[:total], danger, self.rules.most, self.rules.apart,
            self._marks, self._used, *self._chosen,
        )  # fmt: skip
        if count < 0:
            raise BadInput("the danger of a seen point is not finite")
        near, leads = self._near[:total], self._leads[:total]
        if len(hidden):
            near, leads = np.concatenate((near, hidden)), np.concatenate((leads, since))
        else:  # not our memory of the next tick
            near, leads = near.copy(), leads.copy()
        where, on, how = self._chosen
        return Ranged(where[:count].copy(), on[:count].copy(), how[:count].copy(), near, leads, tuple(notes))

    def _hidden(self, now: float, state: RobotState, wire: Wire) -> Array:
        """Where somebody may be whom no sensor sees, by the last images (p, 3) [m]; none unless that is asked for."""
        anew = self._looked or now - self._hidden_at > AGAIN  # the robot goes on where no image comes
        if self.rules.unseen == OCCUPIED and anew and self._together is not None:
            places = self._together.unseen(wire, state.body_poses(), now)
            self._hidden_places, self._looked, self._hidden_at = places, False, now
        return self._hidden_places

    def _ahead(self, points: Array, velocities: Array, wire: Wire, field: Any) -> tuple[Array, Array]:
        """Where points that move count, and their velocities there; at rest by a field of another making."""
        if not self.sensing.velocities or type(field) is not DangerField:
            return points, np.zeros_like(velocities)
        elapsed, weights = self._ages[: len(points)] + self.rules.horizon, (field.static, field.kinetic, field.gamma)
        return self._foresight(points, velocities, elapsed, self.sensing.d_min, wire, weights, field.floor)

    def _take_all(self, images: Any, now: float, wire: Wire) -> list[str]:
        """Take the images that came, as many as there is time for; what is wrong, in words."""
        self.inbox.put(images)
        taken, notes = self.inbox.take()
        for who, image in taken:
            try:
                wrong = self._take(who, image, now, wire)
            except BadInput as problem:
                wrong = str(problem)
            if wrong and wrong != LATE:
                notes.append(f"image of {self.sensors[who].name} unusable: {wrong}")
        return list(dict.fromkeys(notes))

    def _take(self, who: int, image: RangeImage, now: float, wire: Wire) -> str:
        watch, given = self._watches[who], self._judges[who](image)
        wrong = watch.too_old(given.stamp, now)
        if wrong:
            return wrong
        then = RobotState(self._robot, self._past.at(given.stamp))
        poses, (body, place) = then.body_poses(), self._mounts[who]
        pose = poses[body] @ place
        fixed = self.sensors[who].mount == WORLD
        count, shown = self._reducers[who](given, pose, poses, wire, -1 if fixed else body)
        # what has to move for a frozen image to be told: the sensor, or what a fixed one may see of the robot
        wrong = watch.judged(given.stamp, self._reducers[who].distances, shown, poses if fixed else pose)
        if not wrong:
            self._seen[who] = given.stamp
            velocities = self._still
            if self._tracks:
                around = self._reducers[who].around(count, shown.seen, MOST)
                velocities = self._tracks[who](given.stamp, around, None if fixed else pose)[:count]
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

    def _look(self, now: float) -> list[str]:
        """Which sensors do not see, in words.

        Raises:
            BadInput: Too many.
        """
        if self._begin:
            for watch in self._watches:
                watch.begin = now
            self._seen[:], self._begin, self._until = [watch.seen for watch in self._watches], False, -inf
        if not (self._doubted or now > self._until):
            return []
        self._until = float((self._seen + self._patience).min()) - _ROUNDING  # images that came since put it off
        if not (self._doubted or (now - self._seen > self._patience).any()):
            return []
        kinds: dict[str, list[str]] = {}
        unseen = []
        for sensor, watch in zip(self.sensors, self._watches, strict=True):
            what = watch.look(now)
            if what:
                kinds.setdefault(what, []).append(sensor.name)
                unseen.append(sensor.name)
        self.unseen, self._doubted = tuple(unseen), bool(unseen)
        if not unseen:
            return []
        self.stopped |= sum(watch.dead for watch in self._watches) > self.most
        notes = [f"range sensors {what}, unseen what is before them: {', '.join(who)}" for what, who in kinds.items()]
        if self.stopped or len(unseen) > self.most:
            more = "stopped until acknowledged" if self.stopped else "stopped until they see again"
            raise BadInput("; ".join((f"more than {self.most} range sensors do not see: {more}", *notes)))
        return notes


AGAIN = 0.1  # without any image, hidden places are looked for so often: they are around the robot, which moves [s]
_NONE, _NO_LINKS = np.empty((0, 3)), np.empty(0, dtype=np.int64)
