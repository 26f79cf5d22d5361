"""Everybody on the page at every tick: one person who follows the mouse, and the people of a story, over and over."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.people.person import Foot, Person, PersonPose
from qpsafe.sim.people.posture import HANG, Arm, Posture
from qpsafe.sim.stories.story import Story
from qpsafe.sim.web.stride import Stride

Array = NDArray[np.float64]

PERSON, HAND, AWAY = "person", "hand", "away"
FAR = np.array([40.0, 40.0, 0.0])  # where somebody stands who is not there [m]
AHEAD, RIGHT = 0.42, 0.18  # where a hand is that is dragged, seen from the person who goes along with it [m]
QUICKEST = 4.0  # nobody follows the mouse faster than this [m/s]
WIDEST = 6.0  # nor is dragged farther away [m]
STILL = 5e-4  # below this a hand counts as where it was: the back need not be bent anew [m]


class Drag(NamedTuple):
    """Where the mouse wants somebody.

    Attributes:
        mode: `PERSON`: the feet go there; `HAND`: the right hand does, and a person behind it; `AWAY`: nobody is there.
        place: Of the feet, or of the hand (3,) [m]; feet stand on the floor, whatever the height.
        speed: At most this fast [m/s].
    """

    mode: str = PERSON
    place: tuple[float, float, float] = (1.6, 0.5, 0.0)
    speed: float = 2.0


class Crowd:
    """Who is where, tick by tick.

    Args:
        story: Its first person is the one who is dragged.
        dt: Of a tick [s].

    Attributes:
        drag: What the mouse wants; see `want`.
        place: Where feet or hand are (3,) [m].
    """

    def __init__(self, story: Story, dt: float) -> None:
        self.drag, self._dt = Drag(), dt
        self._person: Person = story.persons[0]
        self._others = PosesAhead(story.people[1:], dt)
        self._length = max(round(story.duration / dt), 1)
        self.place = np.array(self.drag.place)
        self._tick = -1
        self._stooped: tuple[Array, Posture] | None = None
        self._seen: tuple[str, Array, PersonPose] | None = None
        self._stride, self._jumped = Stride(self._person, dt), True

    def want(self, drag: Drag) -> None:
        """Follow another wish from the next tick on.

        Raises:
            ConfigurationError: No such mode, or a place or speed that nobody can have.
        """
        if drag.mode not in (PERSON, HAND, AWAY):
            raise ConfigurationError("Drag", "mode", drag.mode, f"{PERSON}, {HAND} or {AWAY}")
        place = np.asarray(drag.place, dtype=float)
        if place.shape != (3,) or not (np.abs(place) <= WIDEST).all():
            raise ConfigurationError("Drag", "place", drag.place, f"three numbers within {WIDEST:g} m")
        if not 0.0 < drag.speed <= QUICKEST:
            raise ConfigurationError("Drag", "speed", drag.speed, f"above 0 and at most {QUICKEST:g} m/s")
        if drag.mode != self.drag.mode:  # somebody appears, or turns from feet to a hand: no way between them
            self.place, self._jumped = place, True
        self.drag = drag

    def __call__(self, tick: int) -> Sequence[PersonPose]:
        """Everybody at a tick; the person who is dragged moves towards the mouse once a tick."""
        if tick != self._tick:
            self._tick = tick
            way = np.asarray(self.drag.place) - self.place
            far, most = float(np.sqrt(way @ way)), self.drag.speed * self._dt
            self.place = self.place + (way if far <= most else way * (most / far))
        seen = self._seen
        still = seen is not None and seen[0] == self.drag.mode and np.array_equal(seen[1], self.place)
        if seen is None or not (still and self._stride.resting):
            seen = self._seen = self.drag.mode, self.place, self._dragged()
        return (seen[2], *self._others(tick % self._length))

    def _dragged(self) -> PersonPose:
        mode, (x, y, _) = self.drag.mode, self.place
        if mode == AWAY:
            self._jumped = True
            return self._person.pose(float(FAR[0]), float(FAR[1]), 0.0)
        heading = math.atan2(-y, -x)  # towards the robot
        posture = None
        if mode == HAND and self._person.board is None:
            c, s = math.cos(heading), math.sin(heading)
            # the root stands so that the hand is AHEAD of it and RIGHT of its middle
            x, y = float(x - AHEAD * c - RIGHT * s), float(y - AHEAD * s + RIGHT * c)
            posture = self._reaching()
        left, right = self._stride(np.array([x, y, heading]), stepping=not self._jumped).tolist()
        self._jumped = False
        return self._person.pose(float(x), float(y), heading, (Foot(*left), Foot(*right)), posture)

    def _reaching(self) -> Posture:
        """The right hand at its place, with the least stoop."""
        if self._stooped is None or np.abs(self.place - self._stooped[0]).max() > STILL:
            hand = (AHEAD, -RIGHT, float(self.place[2]) - self._person.floor)
            stoop, _ = self._person.least_stoop((HANG, hand))
            self._stooped = self.place, Posture(arms=(Arm(), Arm(HANG, hand)), stoop=stoop)
        return self._stooped[1]
