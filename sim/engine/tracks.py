"""Where everybody is over a whole trial: capsules and boards at every tick, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PersonTracks:
    """All people of a trial at T ticks; S = 17 capsules a person, person after person; world frame.

    Attributes:
        ends: End points of every capsule's axis (T, S, 2, 3) [m].
        radii: Of the capsules (S,) [m].
        boards: Poses of the B boards (T, B, 4, 4): x out of the face, y to its left, z up.
        half_sizes: Of the boards along their axes (B, 3) [m].
        dt: Tick [s].
        names: Body region of every capsule, without its side (S,).
    """

    ends: Array
    radii: Array
    boards: Array
    half_sizes: Array
    dt: float
    names: tuple[str, ...]
