"""The dummy of the Monte Carlo simulation, Fig. 8: a person anywhere in the workspace, arms anyhow.

Every posture is a function of `DRAWS` numbers between 0 and 1, so that whoever draws them decides what is random.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import FIRST, SEGMENTS
from qpsafe.sim.people.limbs import two_link
from qpsafe.sim.people.person import Person

Array = NDArray[np.float64]

#: Numbers that decide a posture: place (2), heading, and per arm azimuth, elevation and stretch.
DRAWS = 9
#: Radii of the capsules [m].
RADII = np.array([segment.radius for segment in SEGMENTS])

_RANGES = (  # of the wrist seen from the shoulder
    (np.deg2rad(-25.0), np.deg2rad(100.0)),  # azimuth, from ahead to the arm's own side
    (np.deg2rad(-85.0), np.deg2rad(60.0)),  # elevation
    (0.45, 0.99),  # distance, of the arm's length
)
_NAMES = [segment.name for segment in SEGMENTS]
# side: row of its upper arm in SEGMENTS; forearm and hand follow
_ROWS = {1.0: _NAMES.index("left_upper_arm"), -1.0: _NAMES.index("right_upper_arm")}


def dummies(draws: Array, radius: float, floor: float) -> Array:
    """Postures of k dummies.

    Args:
        draws: Between 0 and 1, (k, DRAWS).
        radius: They stand in the disc of this radius about the robot's base axis, all places equally likely [m].
        floor: Height of the floor in the world frame [m].

    Returns:
        Ends of the capsules' axes in the order of `SEGMENTS`, (k, 17, 2, 3) [m].
    """
    k = len(draws)
    standing = Person(floor=0.0, board=None).pose(0.0, 0.0, 0.0).ends
    ends = np.repeat(standing[None], k, axis=0)
    for arm, (side, row) in enumerate(_ROWS.items()):
        azimuth, elevation, stretch = (
            low + draws[:, 3 + 3 * arm + i] * (high - low) for i, (low, high) in enumerate(_RANGES)
        )
        shoulder = np.broadcast_to(standing[row, 1], (k, 3))
        level = np.cos(elevation)
        ray = np.stack((level * np.cos(azimuth), side * level * np.sin(azimuth), np.sin(elevation)), axis=1)
        wrist = shoulder + (stretch * (FIRST.upper_arm + FIRST.forearm))[:, None] * ray
        bends = np.tile((-0.25, 0.55 * side, -1.0), (k, 1))  # elbows point down, outwards and a little back
        elbow, wrist = two_link(shoulder, wrist, np.full(k, FIRST.upper_arm), np.full(k, FIRST.forearm), bends)
        along = (wrist - elbow) / np.linalg.norm(wrist - elbow, axis=1, keepdims=True)
        ends[:, row], ends[:, row + 1] = np.stack((elbow, shoulder), 1), np.stack((wrist, elbow), 1)
        ends[:, row + 2] = np.stack((wrist, wrist + FIRST.hand * along), 1)
    distance, place, heading = radius * np.sqrt(draws[:, 0]), 2.0 * np.pi * draws[:, 1], 2.0 * np.pi * draws[:, 2]
    cos, sin = np.cos(heading)[:, None, None], np.sin(heading)[:, None, None]
    turned = np.stack((cos * ends[..., 0] - sin * ends[..., 1], sin * ends[..., 0] + cos * ends[..., 1]), axis=-1)
    root = np.stack((distance * np.cos(place), distance * np.sin(place)), axis=1)
    return np.concatenate((turned + root[:, None, None], ends[..., 2:] + floor), axis=-1)
