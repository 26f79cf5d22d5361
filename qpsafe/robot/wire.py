"""The wire model of a robot: the straight segments whose motion makes the danger field, eq. (4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.text.words import counted


class Wire(NamedTuple):
    """Segments of a robot with the velocities of their ends, world frame.

    Positions and velocities are linear along a segment: r_l = r0 + l (r1 - r0), v_l = v0 + l (v1 - v0), l in [0, 1],
    eq. (4) of the paper. A segment of length zero is allowed and still counts.

    Attributes:
        starts: r0, (links, 3) [m].
        ends: r1, (links, 3) [m].
        start_velocities: v0, (links, 3) [m/s].
        end_velocities: v1, (links, 3) [m/s].
    """

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    start_velocities: NDArray[np.float64]
    end_velocities: NDArray[np.float64]

    def __repr__(self) -> str:
        ends = np.concatenate((self.start_velocities, self.end_velocities))
        fastest = float(np.linalg.norm(ends, axis=1).max(initial=0.0))
        return f"Wire({counted(len(self.starts), 'link')}, fastest end at {fastest:.4g} m/s)"
