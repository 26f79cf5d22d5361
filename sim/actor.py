"""One person of a story: steps in, poses at any time out."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import QpsafeError
from qpsafe.sim.anatomy import Body
from qpsafe.sim.footsteps import Footsteps
from qpsafe.sim.person import Board, Foot, Person, PersonPose
from qpsafe.sim.posture import EDGE, HANG, Arm, Point, Posture, Stoop
from qpsafe.sim.story_steps import PersonTable
from qpsafe.sim.walker import SHARP, TURNING, Course, Root, Turn, Walk, eased

WALK_RATIO = 0.0065  # step length [m] over cadence [steps/min], the same at all usual speeds: Sekiya et al. 1996
STEP = 0.55, 0.40  # longest and shortest time of a step; Footsteps' own is the longest [s]
FARTHER = 0.15  # what is put down stands farther away than it is carried, past the knees [m]
SETTLE = 0.4  # time that the feet take after the root has stopped [s]
LOOK = 0.6  # time to turn the head [s]
NOD = math.radians(40.0)  # how far the head tilts


class StepProblem(QpsafeError, ValueError):
    """A step cannot be done: which person, which key, its value, and what was expected."""

    def __init__(self, person: int, keys: Sequence[str | int], value: object, expected: str) -> None:
        self.person, self.keys, self.value, self.expected = person, list(keys), value, expected
        super().__init__(f"person {person}: {keys} = {value!r}: expected {expected}")


class Taken(NamedTuple):
    """A step as planned: from when to when [s], what, and the number of the step in the file."""

    start: float
    end: float
    do: str
    number: int


class Change(NamedTuple):
    """A value that goes from `a` to `b` between two times [s]; `lift` as in `Arm`."""

    start: float
    end: float
    a: Any
    b: Any
    lift: float = 0.0


class Actor:
    """One person of a story.

    Attributes:
        name: As the file says.
        person: Kinematics, with height and board.
        course: Root at any time.
        steps: As planned.
        events: Time [s] and name of each.
        end: When the last step is done [s].
    """

    def __init__(self, table: PersonTable, index: int, floor: float) -> None:
        """Plan the steps; `index` is the person's place in the file.

        Raises:
            StepProblem: A step cannot be done.
        """
        self.name, self._index = table.name, index
        board = None if table.board is None else Board(**table.board.model_dump(exclude={"carried"}))
        self.person = Person(floor, board, Body.of_height(table.height))
        self.course = Course((*table.start, math.radians(table.heading)))
        self.steps: list[Taken] = []
        self.events: list[tuple[float, str]] = []
        self.end = 0.0
        held = board is not None and table.board is not None and table.board.carried
        self._goals: list[Point | str] = [EDGE if held else HANG] * 2
        self._arms: tuple[list[Change], list[Change]] = ([], [])
        self._first = self._goals[0]
        self._hold: list[Change] = []
        self._nominal = (0.0, 0.0) if board is None else (board.reach, board.centre_height)
        self._at = self._nominal
        self._rests: list[tuple[float, tuple[float, float, float, float] | None]] = []
        if board is not None and not held:
            self._at = (board.reach + FARTHER, 0.5 * board.height)
            self._rest(-math.inf)
        self._gaze: list[Change] = []
        self._stoops: list[Change] = []
        for _ in range(table.repeat):
            for number, step in enumerate(table.step):
                start = self.end
                getattr(self, f"_{step.do}")(step, ["step", number])
                self.steps.append(Taken(start, self.end, step.do, number))
                if step.event is not None:
                    self.events.append((self.end, step.event))

    # --- at a time ---

    def root(self, time: float) -> Root:
        """x, y [m] and heading [rad] at a time [s]."""
        return self.course(time)

    def pose(self, time: float) -> PersonPose:
        """The whole person at a time [s]."""
        return self.person.pose(*self.course(time), self._footsteps(time), self.posture(time))

    def footprints(self, until: float) -> tuple[list[Foot], list[Foot]]:
        """Where left and right foot stand, one after another, until a time [s]."""
        first = self._footsteps(0.0)
        left, right = ([s.goal for s in steps if s.start < until] for steps in self._footsteps.steps)
        return [first[0], *left], [first[1], *right]

    def reached(self, step: Taken) -> list[NDArray[np.float64]]:
        """Where the hands of a reaching step are at its end (3,) [m], those that hang left out."""
        posture, hands = self.posture(step.end), self.pose(step.end).hands
        return [hand for arm, hand in zip(posture.arms, hands, strict=True) if not isinstance(arm.goal, str)]

    def posture(self, time: float) -> Posture:
        """What arms, back and head do at a time [s]."""
        arms = [Arm(self._first, self._first)] * 2
        for i, changes in enumerate(self._arms):
            change = _latest(changes, time)
            if change is not None:
                arms[i] = Arm(change.a, change.b, _share(change, time), change.lift)
        resting = None
        for at, place in self._rests:
            if at <= time:
                resting = place
        hold = self._blend(self._hold, time, self._nominal if not self._rests or self._hold else self._at)
        stoop = Stoop(*self._blend(self._stoops, time, Stoop()))
        return Posture((arms[0], arms[1]), stoop, hold, resting, self._blend(self._gaze, time, (0.0, 0.0)))

    def _blend(self, changes: list[Change], time: float, otherwise: tuple[float, float]) -> tuple[float, float]:
        change = _latest(changes, time)
        if change is None:
            return changes[0].a if changes else otherwise
        s = _share(change, time)
        return (1.0 - s) * change.a[0] + s * change.b[0], (1.0 - s) * change.a[1] + s * change.b[1]

    @cached_property
    def _footsteps(self) -> Footsteps:
        def pace(time: float) -> tuple[float, float]:
            """Time in the air and time with both feet down; the faster, the less of the latter."""
            speed = self.course.speed(time + 0.4)
            cadence = math.sqrt(60.0 * max(speed, 0.1) / (WALK_RATIO * self.person.body.scale))
            step = min(max(60.0 / cadence, STEP[1]), STEP[0])
            both = min(max(0.30 - 0.10 * speed, 0.08), 0.20) * step
            return step - both, both

        return Footsteps(self.person, self.course, self.end + 2.0, lift=0.055 * self.person.body.scale, pace=pace)

    # --- planning, one method a kind of step ---

    def _walk(self, step: Any, keys: list) -> None:
        self._need_free_hands(keys)
        points = [step.to] if isinstance(step.to[0], float) else list(step.to)
        turning, here = step.facing == "travel", self.course.last[:2]
        stretch: list[tuple[float, float]] = []
        before: float | None = None
        for k, point in enumerate(points):
            if math.dist(here, point) < 0.05:
                raise self._problem([*keys, "to"], point, f"a place at least 0.05 m from {_text(here)}, the one before")
            direction = math.atan2(point[1] - here[1], point[0] - here[0])
            if before is not None and abs(math.remainder(direction - before, 2.0 * math.pi)) > SHARP:
                self._go(stretch, step, turning)
                stretch = []
            stretch.append(point)
            before, here = direction, point
            if k == len(points) - 1:
                self._go(stretch, step, turning)

    def _go(self, points: list[tuple[float, float]], step: Any, turning: bool) -> None:
        """Turn towards the first point if need be, then walk."""
        x, y, _ = self.course.last
        if turning:
            self._face(math.atan2(points[0][1] - y, points[0][0] - x), TURNING)
        self.end = self.course.add(Walk(self.end, self.course.last, points, step.speed, turning, step.ease))

    def _face(self, heading: float, rate: float) -> None:
        angle = math.remainder(heading - self.course.last[2], 2.0 * math.pi)
        if abs(angle) > 1e-9:
            duration = max(2.0 * abs(angle) / rate, 0.3)
            self.end = self.course.add(Turn(self.end, self.end + duration, self.course.last, angle))

    def _wait(self, step: Any, keys: list) -> None:
        if (step.time is None) == (step.until is None):
            raise self._problem(keys, "wait", "either time, or until")
        if step.until is not None and step.until < self.end:
            raise self._problem([*keys, "until"], step.until, f"a time not before {self.end:.2f} s, when it comes here")
        self.end = step.until if step.until is not None else self.end + step.time

    def _turn(self, step: Any, keys: list) -> None:
        self._need_free_hands(keys)
        if (step.heading is None) == (step.towards is None):
            raise self._problem(keys, "turn", "either heading, or towards")
        x, y, _ = self.course.last
        if step.towards is None:
            heading = math.radians(step.heading)
        else:
            heading = math.atan2(step.towards[1] - y, step.towards[0] - x)
        self._face(heading, math.radians(step.rate))

    def _reach(self, step: Any, keys: list) -> None:
        arms = _ARMS[step.arm]
        if EDGE in (self._goals[i] for i in arms):
            raise self._problem([*keys, "arm"], step.arm, "a free hand: the board is to be put down before")
        centre, goals = self._local(step.to), list(self._goals)
        for i in arms:
            aside = 0.0 if len(arms) == 1 else (0.5 - i) * step.apart
            goals[i] = (centre[0], centre[1] + aside, centre[2])
            alone: list[Point | str] = [HANG, HANG]
            alone[i] = goals[i]
            _, lack = self.person.least_stoop(alone)
            if lack > 0.0:
                side, here = ("left", "right")[i], _text(self.course.last)
                expected = f"a point within reach from {here}: it is {lack:.3f} m too far for the {side} hand"
                raise self._problem([*keys, "to"], step.to, expected)
        if self.person.least_stoop(goals)[1] > 0.0:
            raise self._problem([*keys, "to"], step.to, "a point within reach while the other hand stays where it is")
        self._tilt(centre)
        self._move_arms(goals, step.speed)

    def _retract(self, step: Any, keys: list) -> None:
        goals = list(self._goals)
        for i in _ARMS[step.arm]:
            if goals[i] == EDGE:
                raise self._problem(keys, "retract", "hands that do not hold the board: put it down")
            goals[i] = HANG
        self._tilt(None)
        self._move_arms(goals, step.speed)

    def _put_down(self, step: Any, keys: list) -> None:
        board = self.person.board
        if board is None or self._goals[0] != EDGE:
            raise self._problem(keys, "put_down", "a board in both hands")
        low = (board.reach + FARTHER, step.onto + 0.5 * board.height)
        _, lack = self.person.least_stoop((EDGE, EDGE), low)
        if lack > 0.0:
            raise self._problem([*keys, "onto"], step.onto, f"a height that the hands can go to: {lack:.3f} m too far")
        self._move_board(low, step.speed)
        self._rest(self.end)
        self._move_arms([HANG, HANG], step.speed)

    def _carry(self, step: Any, keys: list) -> None:
        place = self._rests[-1][1] if self._rests else None
        if place is None or self.person.board is None:
            raise self._problem(keys, "carry", "a board that has been put down")
        x, y, heading = self.course.last
        where = (place[0] - self._at[0] * math.cos(place[2]), place[1] - self._at[0] * math.sin(place[2]))
        off = math.dist(where, (x, y)) + abs(math.remainder(place[2] - heading, 2.0 * math.pi))
        if off > 0.01:
            expected = f"to stand where it was put down: {_text(where)}, heading {math.degrees(place[2]):.1f} deg"
            raise self._problem(keys, _text((x, y)), expected)
        if self._goals != [HANG, HANG]:
            raise self._problem(keys, "carry", "both hands free: retract before")
        self._move_arms([EDGE, EDGE], step.speed)
        self._rests.append((self.end, None))
        self._move_board(self._nominal, step.speed)

    def _look(self, step: Any, keys: list) -> None:
        self._tilt(None if step.at is None else self._local(step.at))
        self.end += LOOK

    # --- parts of steps ---

    def _move_arms(self, goals: Sequence[Point | str], speed: float) -> None:
        """Move both hands to goals, the back with them, with no hand faster than a speed [m/s]."""
        if list(goals) == self._goals:
            return
        before, after = self._stoop, self.person.least_stoop(goals, self._at)[0]
        ways = [Arm(a, b, 0.0) for a, b in zip(self._goals, goals, strict=True)]

        def hands(share: float) -> Any:
            stoop = Stoop(*((1.0 - share) * np.array(before) + share * np.array(after)))
            posture = Posture(tuple(way._replace(share=share) for way in ways), stoop, self._at)  # type: ignore[arg-type]
            return self.person.pose(0.0, 0.0, 0.0, posture=posture).hands

        apart = np.linalg.norm(hands(1.0) - hands(0.0), axis=1)
        ways = [
            way._replace(lift=0.12 * float(d) * (way.start != way.goal)) for way, d in zip(ways, apart, strict=True)
        ]
        path = np.array([hands(share) for share in np.linspace(0.0, 1.0, 41)])
        fastest = float(np.linalg.norm(np.diff(path, axis=0), axis=2).max()) * 40
        self.end = max(self.end, self._settled)
        end = self.end + max(2.0 * 1.01 * fastest / speed, 0.2)  # eased() goes at twice its mean rate
        for changes, way in zip(self._arms, ways, strict=True):
            if way.start != way.goal:
                changes.append(Change(self.end, end, way.start, way.goal, way.lift))
        self._goals = list(goals)
        self._bend(after, end)

    @property
    def _settled(self) -> float:
        """When the feet stand after the last walk or turn [s]."""
        return self.course.end + SETTLE if self.course.end > 0.0 else 0.0

    @property
    def _stoop(self) -> Stoop:
        return self._stoops[-1].b if self._stoops else Stoop()

    def _bend(self, to: Stoop, end: float) -> None:
        """Stoop, or rise, until `end`, which the step ends with."""
        self._stoops.append(Change(self.end, end, self._stoop, to))
        self.end = end

    def _move_board(self, to: tuple[float, float], speed: float) -> None:
        self.end = max(self.end, self._settled)
        end = self.end + max(2.0 * math.dist(self._at, to) / speed, 0.2)
        self._hold.append(Change(self.end, end, self._at, to))
        self._at = to
        self._bend(self.person.least_stoop((EDGE, EDGE), to)[0], end)

    def _rest(self, time: float) -> None:
        """Leave the board where it is now."""
        x, y, heading = self.course.last
        reach, centre = self._at
        self._rests.append((time, (x + reach * math.cos(heading), y + reach * math.sin(heading), heading, centre)))

    def _tilt(self, point: Point | None) -> None:
        """Begin to look at a point of the root's frame, or ahead."""
        goal = (0.0, 0.0)
        if point is not None:
            eyes = 0.93 * self.person.body.height
            away = math.hypot(point[0], point[1])
            nod = min(max(math.atan2(eyes - point[2], away), 0.0), NOD)
            goal = (nod * point[0] / max(away, 1e-6), nod * point[1] / max(away, 1e-6))
        last = self._gaze[-1] if self._gaze else Change(-1.0, -0.5, goal, (0.0, 0.0))
        start = max(self.end, last.end)
        self._gaze.append(Change(start, start + LOOK, last.b, goal))

    def _local(self, point: Point) -> Point:
        """A point of the world in the root's frame."""
        x, y, heading = self.course.last
        dx, dy, c, s = point[0] - x, point[1] - y, math.cos(heading), math.sin(heading)
        return c * dx + s * dy, c * dy - s * dx, point[2] - self.person.floor

    def _need_free_hands(self, keys: list) -> None:
        if any(not isinstance(goal, str) for goal in self._goals):
            raise self._problem(keys, "hands that reach", "to retract before walking or turning")

    def _problem(self, keys: Sequence[str | int], value: object, expected: str) -> StepProblem:
        return StepProblem(self._index, keys, value, expected)


_ARMS = {"left": (0,), "right": (1,), "both": (0, 1)}


def _latest(changes: list[Change], time: float) -> Change | None:
    index = bisect.bisect_right(changes, time, key=lambda change: change.start) - 1
    return None if index < 0 else changes[index]


def _share(change: Change, time: float) -> float:
    return eased((time - change.start) / (change.end - change.start))


def _text(place: Sequence[float]) -> str:
    return f"({place[0]:.2f}, {place[1]:.2f})"
