"""What images tell in one tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PERSON = 1.6  # how fast people come, ISO 13855 [m/s]


#: Columns of a point that counts: place [m], the part of its velocity towards the wire [m/s], danger there, gradient.
PLACE, VELOCITY, DANGER, GRADIENT, COLUMNS = 0, 3, 6, 7, 10


class Ranged(NamedTuple):
    """What the images tell in one tick.

    Attributes:
        points: That count in eq. (8), world frame (p, COLUMNS).
        links: Wire link of each (p,).
        near: All that is known near the robot, where it was seen (e, 3) [m].
        leads: For how long before now somebody could have come from there (e,) [s].
        notes: What is wrong, in words.
    """

    points: Array
    links: NDArray[np.int64]
    near: Array
    leads: Array
    notes: tuple[str, ...] = ()
