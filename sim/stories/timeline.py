"""The time line of one person of a story: when root, hands, back, head and board go from where to where."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from qpsafe.sim.people.anatomy import Body
from qpsafe.sim.people.person import Board, Person
from qpsafe.sim.people.posture import EDGE, HANG, Arm, Point, Posture, Stoop
from qpsafe.sim.people.walker import TURNING, Course, Turn, Walk
from qpsafe.sim.stories.steps import PersonTable

FARTHER = 0.15  # what is put down stands farther away than it is carried, past the knees [m]
SETTLE = 0.4  # time that the feet take after the root has stopped [s]
LOOK = 0.6  # time to turn the head [s]
NOD = math.radians(40.0)  # how far the head tilts


class Change(NamedTuple):
    """A value that goes from `a` to `b` between two times [s]; `lift` as in `Arm`."""

    start: float
    end: float
    a: Any
    b: Any
    lift: float = 0.0


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
