"""The time line of one person of a story: when root, hands, back, head and board go from where to where."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import Body
from qpsafe.sim.people.person import Board, Person
from qpsafe.sim.people.posture import EDGE, HANG, Point, Postures, Stoop, between, goal_row
from qpsafe.sim.people.walker import TURNING, Course, Turn, Walk
from qpsafe.sim.stories.changes import Changes, world_row
from qpsafe.sim.stories.steps import PersonTable

Array = NDArray[np.float64]

FARTHER = 0.15  # what is put down stands farther away than it is carried, past the knees [m]
SETTLE = 0.4  # time that the feet take after the root has stopped [s]
LOOK = 0.6  # time to turn the head [s]
NOD = math.radians(40.0)  # how far the head tilts


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
        ends, lifts = self._ways(goals, before, after, np.array([0.0, 1.0]), np.zeros((2, 1))), np.zeros((2, 1))
        for i, apart in enumerate(np.linalg.norm(ends[1] - ends[0], axis=1)):
            lifts[i] = 0.12 * apart * (self._goals[i] != goals[i])
        path = self._ways(goals, before, after, np.linspace(0.0, 1.0, 41), lifts)
        fastest = float(np.linalg.norm(np.diff(path, axis=0), axis=2).max()) * 40
        self.end = max(self.end, self._settled)
        end = self.end + max(2.0 * 1.01 * fastest / speed, 0.2)  # eased() goes at twice its mean rate
        for i, changes in enumerate(self._arms):
            if self._goals[i] != goals[i]:
                changes.add(self.end, end, world_row(goals[i], *self._here), float(lifts[i, 0]))
        self._goals = list(goals)
        self._bend(after, end)

    def _ways(self, goals: Sequence[Point | str], before: Stoop, after: Stoop, shares: Array, lifts: Array) -> Array:
        """Hands (T, 2, 3) on their way from where they are to goals when so much of it is done (T,), standing."""
        share = shares[:, None]
        rows = [between(goal_row(a), goal_row(b), share, lift)
                for a, b, lift in zip(self._goals, goals, lifts, strict=True)]  # fmt: skip
        stoop = (1.0 - share) * np.array(before) + share * np.array(after)
        postures = Postures(np.stack(rows, axis=1), stoop, np.zeros((1, 2)), np.array([self._at]))
        return self.person.poses(np.zeros((len(shares), 3)), None, postures).hands

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
