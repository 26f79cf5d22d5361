"""The person's proportions: bone lengths, capsules and colours of somebody 1.75 m tall."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

SKIN = (0.86, 0.66, 0.54, 1.0)
SHIRT = (0.20, 0.42, 0.62, 1.0)
TROUSERS = (0.23, 0.25, 0.30, 1.0)
SHOES = (0.12, 0.12, 0.13, 1.0)
CARDBOARD = (0.74, 0.56, 0.36, 1.0)

# Bone lengths and heights of a person of 1.75 m [m].
ANKLE = 0.080  # above the sole
SHANK = 0.420
THIGH = 0.420
UPPER_ARM = 0.290
FOREARM = 0.250
HAND = 0.075
HIP = 0.090  # half width
SHOULDER = 0.180  # half width
HEEL, TOE = 0.055, 0.130  # behind and before the ankle
FOOT_RADIUS = 0.036
LEG_USED = 0.985  # a standing leg is not quite straight, so the knee always knows where to bend
HEEL_OFF = math.radians(32.0)  # largest heel rise of a foot that trails


class Segment(NamedTuple):
    """A capsule of the person.

    Attributes:
        name: Name of the body segment.
        radius: [m].
        length: Between the centres of the two round ends [m].
        colour: RGBA, 0 to 1.
    """

    name: str
    radius: float
    length: float
    colour: tuple[float, float, float, float]


# Trunk: end points of the axes in the root's frame, heights above the hip joint [m]. Order of the first SEGMENTS.
TRUNK = np.array(
    [
        [[0.0, 0.0, 0.130], [0.0, 0.0, 0.385]],  # torso
        [[0.0, 0.0, 0.490], [0.0, 0.0, 0.600]],  # neck
        [[0.01, 0.0, 0.650], [0.01, 0.0, 0.735]],  # head
        [[0.0, -0.055, 0.030], [0.0, 0.055, 0.030]],  # pelvis
        [[0.0, -0.125, 0.455], [0.0, 0.125, 0.455]],  # shoulders
    ]
)
SHOULDER_HEIGHT = 0.455  # above the hip joint

SEGMENTS: tuple[Segment, ...] = (
    Segment("torso", 0.130, 0.255, SHIRT),
    Segment("neck", 0.050, 0.110, SKIN),
    Segment("head", 0.092, 0.085, SKIN),
    Segment("pelvis", 0.108, 0.110, TROUSERS),
    Segment("shoulders", 0.068, 0.250, SHIRT),
    *(
        Segment(f"{side}_{name}", radius, length, colour)
        for side in ("left", "right")
        for name, radius, length, colour in (
            ("thigh", 0.072, THIGH, TROUSERS),
            ("shank", 0.050, SHANK, TROUSERS),
            ("foot", FOOT_RADIUS, HEEL + TOE, SHOES),
            ("upper_arm", 0.046, UPPER_ARM, SHIRT),
            ("forearm", 0.037, FOREARM, SKIN),
            ("hand", 0.033, HAND, SKIN),
        )
    ),
)
