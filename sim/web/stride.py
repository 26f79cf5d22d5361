"""Steps of somebody who is dragged with the mouse: nobody knows where to beforehand, so feet are found tick by tick."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.person import Person

Array = NDArray[np.float64]

LENGTH = 1.2  # way of the body in two steps [m]
LIFT = 0.05  # of a foot that swings [m]
SLOW = 0.4  # below this, steps get shorter [m/s]
SMOOTH = 0.12  # time constant of the velocity that steps follow [s]
REST = 0.02  # slower than this somebody stands [m/s]


class Stride:
    """Feet of a person whose root moves as somebody else wishes.

    With u the root's smoothed velocity and the phase p = way/`LENGTH` (mod 1), half a cycle later for the right foot, a
    foot is ahead of where it would stand by w(p) `LENGTH` along u: w = 1/4 - p while it stands (p < 1/2), which is the
    root's way backwards, so that the foot stays where it is; from -1/4 back to 1/4 while it swings.

    Args:
        person: Whose feet.
        dt: Tick [s].
    """

    def __init__(self, person: Person, dt: float) -> None:
        self._person, self._dt = person, dt
        self._velocity, self._phase = np.zeros(2), 0.0
        self._last: Array | None = None

    @property
    def resting(self) -> bool:
        """Whether both feet stand."""
        return not self._velocity.any()

    def __call__(self, root: Array, stepping: bool = True) -> Array:
        """Rows of `Foot`, left and right (2, 4), a tick later.

        Args:
            root: x, y [m] and heading [rad] (3,).
            stepping: False where the root has jumped: both feet stand.
        """
        if self._last is None or not stepping:
            self._last, self._velocity = root, np.zeros(2)
        way, self._last = root[:2] - self._last[:2], root
        self._velocity = self._velocity + (way / self._dt - self._velocity) * (self._dt / SMOOTH)
        speed = float(np.hypot(*self._velocity))
        if speed < REST and not way.any():
            self._velocity, speed = np.zeros(2), 0.0
        self._phase = (self._phase + float(np.hypot(*way)) / LENGTH) % 1.0
        feet = self._person.standing(root[None])[0]
        for foot, phase in zip(feet, (self._phase, (self._phase + 0.5) % 1.0), strict=True):
            share = max(2.0 * phase - 1.0, 0.0)  # of the swing
            ahead = 0.25 - phase if phase < 0.5 else 0.5 * share**2 * (3.0 - 2.0 * share) - 0.25
            foot[:2] += self._velocity / max(speed, SLOW) * ahead * LENGTH
            foot[3] = LIFT * min(speed / SLOW, 1.0) * math.sin(math.pi * share) ** 2
        return feet
