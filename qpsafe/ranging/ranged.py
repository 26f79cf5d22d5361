"""What images tell in one tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PERSON = 1.6  # how fast people come, ISO 13855 [m/s]


class Ranged(NamedTuple):
    """What the images tell in one tick.

    Attributes:
        points: That count in eq. (8), (p, 3), world frame [m].
        links: Wire link of each (p,).
        velocities: The part towards that link (p, 3) [m/s].
        near: All that is known near the robot, where it was seen (e, 3) [m].
        leads: For how long before now somebody could have come from there (e,) [s].
        notes: What is wrong, in words.
    """

    points: Array
    links: NDArray[np.int64]
    velocities: Array
    near: Array
    leads: Array
    notes: tuple[str, ...] = ()
