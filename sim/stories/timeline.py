"""The time line of one person of a story: when root, hands, back, head and board go from where to where."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import Body
from qpsafe.sim.people.paces import COSINE, minimum_jerk, peak
from qpsafe.sim.people.person import Board, Person
from qpsafe.sim.people.posture import EDGE, HANG, LEAN, Point, Postures, Stoop, between, goal_row
from qpsafe.sim.people.walker import TURNING, Course, Turn, Walk
from qpsafe.sim.stories.changes import Changes, world_row
from qpsafe.sim.stories.steps import PersonTable

Array = NDArray[np.float64]

FARTHER = 0.15  # what is put down stands farther away than it is carried, past the knees [m]
SETTLE = 0.4  # time that the feet take after the root has stopped [s]
LOOK = 0.6  # time to turn the head [s]
NOD = math.radians(40.0)  # how far the head tilts
SINK = 0.15  # how far the hips sink in a fall that leans as far as `LEAN` [m]
THROW = math.radians(20.0)  # below level: where the hands are thrown in a fall
BESIDE = 0.5  # how far from the root a hand is that hangs, at most [m]


class TimeLine:
    """What one person does, as movements one after another.

    Attributes:
        person: Kinematics, with height and board.
        course: Root at any time.
        end: When the last movement is done [s].
    """

    def __init__(self, table: PersonTable, floor: float) -> None:
        board = None if table.board is None else Board(**table.board.model_dump(exclude={"carried"}))
        self.person = Person(floor, board, Body.of_height(table.height))
        self.course = Course((*table.start, math.radians(table.heading)))
        self.end = 0.0
        held = board is not None and table.board is not None and table.board.carried
        self._goals: list[Point | str] = [EDGE if held else HANG] * 2
        self._nominal = (0.0, 0.0) if board is None else (board.reach, board.centre_height)
        self._at = self._nominal
        self._rests: list[tuple[float, tuple[float, float, float, float] | None]] = []
        if board is not None and not held:
            self._at = (board.reach + FARTHER, 0.5 * board.height)
            self._rest(-math.inf)
        first = world_row(self._goals[0], *self._here)
        self._arms = (Changes(first), Changes(first))
        self._hold, self._gaze, self._stoops = Changes(self._at), Changes((0.0, 0.0)), Changes(Stoop())

    def _go(self, points: list[tuple[float, float]], step: Any, turning: bool) -> None:
        """Turn towards the first point if need be, then walk."""
        x, y, _ = self.course.last
        if turning:
            self._face(math.atan2(points[0][1] - y, points[0][0] - x), TURNING)
        self.end = self.course.add(Walk(self.end, self.course.last, points, step.speed, turning, step.ease, step.stop))

    def _face(self, heading: float, rate: float) -> None:
        angle = math.remainder(heading - self.course.last[2], 2.0 * math.pi)
        if abs(angle) > 1e-9:
            duration = max(2.0 * abs(angle) / rate, 0.3)
            self.end = self.course.add(Turn(self.end, self.end + duration, self.course.last, angle))

    def _move_arms(self, goals: Sequence[Point | str], speed: float, late: float = COSINE, early: float = 0.0) -> None:
        """Move both hands to goals, the back with them; see `_swing`.

        Args:
            goals: Of left and right hand; points stay where they are in the world.
            speed: Of the hands [m/s].
            late: How they go, see `paces`.
            early: How long before now they begin [s].
        """
        if list(goals) != self._goals:
            start = self.end - early if early > 0.0 else max(self.end, self._settled)
            after = self.person.least_stoop(goals, self._at)[0]
            self._swing(start, goals, [world_row(goal, *self._here) for goal in goals], after, speed, late)

    def _swing(
        self,
        start: float,
        goals: Sequence[Point | str],
        rows: Sequence[Array],
        after: Stoop,
        speed: float,
        late: float,
        least: float = 0.2,
    ) -> None:
        """Move both hands to goals and the back to a stoop, with no hand faster than a speed, seen from the walker.

        Args:
            start: When, or as soon as the last movement is done [s].
            goals: Of left and right hand, in the root's frame at the end.
            rows: The same as `world_row` has them.
            after: Stoop at the end.
            speed: Of the hands [m/s].
            late: How they go, see `paces`.
            least: Time that it takes at least [s].
        """
        start = max(start, 0.0, self._stoops.end, *(changes.end for changes in self._arms))
        before = self._stoop
        ends, lifts = self._ways(goals, before, after, np.array([0.0, 1.0]), np.zeros((2, 1))), np.zeros((2, 1))
        for i, apart in enumerate(np.linalg.norm(ends[1] - ends[0], axis=1)):
            lifts[i] = 0.12 * apart * (self._goals[i] != goals[i])
        # the cosine's fastest rate counts wherever the hands' own is largest; of a minimum jerk the product is known
        even, rate = np.linspace(0.0, 1.0, 41), peak(late)
        path = self._ways(goals, before, after, even if late < 0.0 else minimum_jerk(even, late), lifts)
        fastest = float(np.linalg.norm(np.diff(path, axis=0), axis=2).max()) * 40 * (rate if late < 0.0 else 1.0)
        still = 0.0
        if any(row[8] > 0.0 for row in rows):  # who still walks comes nearer to a point: so much longer is the way
            x, y, heading = (float(value) for value in self.course(start))
            still = math.dist((x, y), self.course.last[:2]) + BESIDE * abs(heading - self.course.last[2])
        end = start + max(1.01 * (fastest + rate * still) / speed, least)
        for i, changes in enumerate(self._arms):
            if self._goals[i] != goals[i]:
                changes.add(start, end, rows[i], late, float(lifts[i, 0]))
        self._goals = list(goals)
        self._stoops.add(start, end, after, late)
        self.end = max(self.end, end)

    def _ways(self, goals: Sequence[Point | str], before: Stoop, after: Stoop, shares: Array, lifts: Array) -> Array:
        """Hands (T, 2, 3) on their way from where they are to goals when so much of it is done (T,), standing."""
        share = shares[:, None]
        rows = [between(goal_row(a), goal_row(b), share, lift)
                for a, b, lift in zip(self._goals, goals, lifts, strict=True)]  # fmt: skip
        stoop = (1.0 - share) * np.array(before) + share * np.array(after)
        postures = Postures(np.stack(rows, axis=1), stoop, np.zeros((1, 2)), np.array([self._at]))
        return self.person.poses(np.zeros((len(shares), 3)), None, postures).hands

    def _fall(self, start: float, lean: float, speed: float) -> None:
        """Lean forwards and throw both hands ahead of the shoulders, as far as they easily go.

        Args:
            start: When [s].
            lean: Of the trunk [rad].
            speed: Of the hands [m/s].
        """
        body, stoop = self.person.body, Stoop(lean, SINK * lean / LEAN * self.person.body.scale)
        thrown = 0.75 * (body.upper_arm + body.forearm + body.hand)
        ahead, down = thrown * math.cos(THROW), thrown * math.sin(THROW)
        shoulders = self.person.shoulders(stoop)
        goals: list[Point | str] = [(float(x) + ahead, float(y), float(z) - down) for x, y, z in shoulders]
        begun = max(start, 0.0, self._gaze.end)
        self._swing(start, goals, [np.pad(goal_row(goal), (0, 4)) for goal in goals], stoop, speed, late=1.0)
        self._gaze.add(begun, max(self._stoops.end, begun + 0.2), (-0.5 * lean, 0.0))  # eyes ahead

    def _rise(self, speed: float, least: float) -> None:
        """Stand upright again with hanging arms, in so much time [s] or more."""
        self._gaze.add(max(self.end, self._gaze.end), max(self.end, self._gaze.end) + LOOK, (0.0, 0.0))
        hanging = world_row(HANG, *self._here)
        self._swing(self.end, [HANG, HANG], [hanging, hanging], Stoop(), speed, late=0.0, least=least)

    @property
    def _here(self) -> tuple[tuple[float, float, float], float]:
        """The root now, and the height of the floor."""
        return self.course.last, self.person.floor

    @property
    def _settled(self) -> float:
        """When the feet stand after the last walk or turn [s]."""
        return self.course.end + SETTLE if self.course.end > 0.0 else 0.0

    @property
    def _stoop(self) -> Stoop:
        return Stoop(*self._stoops.last)

    def _bend(self, to: Stoop, end: float) -> None:
        """Stoop, or rise, until `end`, which the step ends with."""
        self._stoops.add(self.end, end, to)
        self.end = end

    def _move_board(self, to: tuple[float, float], speed: float) -> None:
        self.end = max(self.end, self._settled)
        end = self.end + max(2.0 * math.dist(self._at, to) / speed, 0.2)
        self._hold.add(self.end, end, to)
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
        start = max(self.end, self._gaze.end)
        self._gaze.add(start, start + LOOK, goal)

    def _local(self, point: Point) -> Point:
        """A point of the world in the root's frame."""
        x, y, heading = self.course.last
        dx, dy, c, s = point[0] - x, point[1] - y, math.cos(heading), math.sin(heading)
        return c * dx + s * dy, c * dy - s * dx, point[2] - self.person.floor
