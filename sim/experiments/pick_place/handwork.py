"""What people do with screws: they take one out of the box, or put one they brought along into an empty hole.

A hand that comes to rest does what it came for: in the box it takes the nearest screw within reach of the fingers, at
the support it puts one that it carries into the nearest empty hole. So a story only says where hands go. Screws in a
hand move with it; those in one hand lie side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.experiments.pick_place.cell import Cell, Parts, Screw
from qpsafe.sim.people.person import PersonPose

Array = NDArray[np.float64]

REACH = 0.12  # of the fingers about the tip of the hand [m]
REST, MOVING = 0.03, 0.15  # speeds below and above which a hand rests and moves [m/s]


class Deed(NamedTuple):
    """Something a person did.

    Attributes:
        kind: ``take`` or ``place``, or ``nothing`` when there was none to take or nowhere to place it.
        person: Number of the person, from 0.
        screw: Number of the screw, -1 for none.
    """

    kind: str
    person: int
    screw: int


class Handwork:
    """Moves screws with people's hands.

    Args:
        cell: Where box and holes are.
        parts: The screws.
        carried: How many screws each person brings along; they are the last ones of the cell, person by person.
        dt: Tick [s].
    """

    def __init__(self, cell: Cell, parts: Parts, carried: Sequence[int], dt: float) -> None:
        self._cell, self._parts, self._dt = cell, parts, dt
        numbers = iter(range(cell.full, cell.screws))
        #: Screws in the hands of each person.
        self.held: list[list[int]] = [[next(numbers) for _ in range(count)] for count in carried]
        self._hand = [1] * len(carried)  # which hand holds them
        self._tips: Array | None = None
        self._moving = np.zeros((len(carried), 2), dtype=bool)

    def update(self, data: Any, poses: Sequence[PersonPose], taken: Sequence[int] = ()) -> list[Deed]:
        """Let hands do what they came for and screws go along; `taken` are screws that nobody can have.

        Call it at every tick, before the poses of geoms are brought up to date.

        Args:
            data: MuJoCo's state.
            poses: Of every person.
            taken: Screws that nobody can have.
        """
        tips = np.array([pose.hands for pose in poses]).reshape(-1, 2, 3)
        speed = np.zeros(tips.shape[:2])
        if self._tips is not None:
            speed = np.linalg.norm(tips - self._tips, axis=2) / self._dt
        self._tips = tips
        deeds = []
        for person, hand in np.argwhere(self._moving & (speed < REST)):
            self._moving[person, hand] = False
            deed = self._act(data, int(person), tips[person, hand], taken)
            if deed is not None:
                self._hand[person] = int(hand)
                deeds.append(deed)
        self._moving |= speed > MOVING
        for person, screws in enumerate(self.held):
            for slot, screw in enumerate(screws):
                beside = np.array([0.0, 0.0, 2.5 * Screw.HEAD_RADIUS * slot])
                self._parts.put(data, screw, tips[person, self._hand[person]] + beside)
        return deeds

    def _act(self, data: Any, person: int, tip: Array, taken: Sequence[int]) -> Deed | None:
        places = self._parts.positions(data)
        in_hands = {screw for screws in self.held for screw in screws}
        box = self._cell.box
        aside = np.abs(tip[:2] - box.centre) - (0.5 * box.length, 0.5 * box.width)
        if (aside < REACH / 2).all():
            away = np.linalg.norm(places - tip, axis=1)
            away[~self._cell.in_box(places)] = np.inf
            away[[*in_hands, *taken]] = np.inf
            nearest = int(np.argmin(away))
            if not away[nearest] <= 2.0 * REACH:
                return Deed("nothing", person, -1)
            self.held[person].append(nearest)
            return Deed("take", person, nearest)
        away = np.linalg.norm(self._cell.holes - tip, axis=1)
        if not away.min() <= REACH:
            return None
        away[self.filled(np.delete(places, list(in_hands), axis=0))] = np.inf
        hole = int(np.argmin(away))
        if not self.held[person] or not away[hole] <= REACH:
            return Deed("nothing", person, -1)
        screw = self.held[person].pop()
        self._parts.put(data, screw, self._cell.holes[hole])
        return Deed("place", person, screw)

    def filled(self, places: Array) -> NDArray[np.bool_]:
        """Which holes have one of some screws (k, 3) in or over them, (holes,)."""
        gaps = np.linalg.norm(self._cell.holes[:, None, :2] - places[None, :, :2], axis=2)
        near = (gaps < 0.5 * self._cell.support.pitch) & (places[:, 2] < self._cell.holes[0, 2] + 0.1)
        return np.asarray(near.any(axis=1))
