"""Plans what one person of a story does, one method a kind of step; what cannot be done is named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from qpsafe.errors import QpsafeError
from qpsafe.sim.people.paces import COSINE
from qpsafe.sim.people.posture import EDGE, HANG, Point
from qpsafe.sim.people.walker import SHARP
from qpsafe.sim.stories.steps import PersonTable
from qpsafe.sim.stories.timeline import FARTHER, LOOK, TimeLine


class StepProblem(QpsafeError, ValueError):
    """A step cannot be done: which person, which key, its value, and what was expected.

    Args:
        person: Place in the file, from 0.
        keys: Where the value is.
        value: As found.
        expected: Instead, in words.
    """

    def __init__(self, person: int, keys: Sequence[str | int], value: object, expected: str) -> None:
        self.person, self.keys, self.value, self.expected = person, list(keys), value, expected
        super().__init__(f"person {person}: {keys} = {value!r}: expected {expected}")


class Taken(NamedTuple):
    """A step as planned: from when to when [s], what, and the number of the step in the file."""

    start: float
    end: float
    do: str
    number: int


class Plan(TimeLine):
    """The steps of one person, one after another in time.

    Attributes:
        name: As the file says.
        steps: As planned.
        events: Time [s] and name of each.
    """

    def __init__(self, table: PersonTable, index: int, floor: float) -> None:
        """Plan the steps; `index` is the person's place in the file.

        Args:
            table: The person's, from the file.
            index: Place in the file, from 0.
            floor: Height of the floor [m].

        Raises:
            StepProblem: A step cannot be done.
        """
        self.name, self._index = table.name, index
        super().__init__(table, floor)
        self.steps: list[Taken] = []
        self.events: list[tuple[float, str]] = []
        for _ in range(table.repeat):
            for number, step in enumerate(table.step):
                start = self.end
                getattr(self, f"_{step.do}")(step, ["step", number])
                self.steps.append(Taken(start, self.end, step.do, number))
                if step.event is not None:
                    self.events.append((self.end, step.event))

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
        self._move_arms(goals, step.speed, _late(step), step.early)

    def _retract(self, step: Any, keys: list) -> None:
        goals = list(self._goals)
        for i in _ARMS[step.arm]:
            if goals[i] == EDGE:
                raise self._problem(keys, "retract", "hands that do not hold the board: put it down")
            goals[i] = HANG
        self._tilt(None)
        self._move_arms(goals, step.speed, _late(step))

    def _stumble(self, step: Any, keys: list) -> None:
        if self._goals != [HANG, HANG]:
            raise self._problem(keys, "stumble", "both hands free and hanging")
        self._fall(self.end - step.early, math.radians(step.lean), step.speed)
        self.end += step.down
        self._rise(step.speed, step.rise)

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

    def _need_free_hands(self, keys: list) -> None:
        if any(not isinstance(goal, str) for goal in self._goals):
            raise self._problem(keys, "hands that reach", "to retract before walking or turning")

    def _problem(self, keys: Sequence[str | int], value: object, expected: str) -> StepProblem:
        return StepProblem(self._index, keys, value, expected)


_ARMS = {"left": (0,), "right": (1,), "both": (0, 1)}


def _late(step: Any) -> float:
    """How a hand goes, as `paces` has it."""
    return COSINE if step.profile == "cosine" else float(step.late)


def _text(place: Sequence[float]) -> str:
    return f"({place[0]:.2f}, {place[1]:.2f})"
