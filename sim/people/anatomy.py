"""The person's proportions: bone lengths, capsules and colours, scaled by body height; and how fast people move.

Sources:

- Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, fig. 4.1 (after Drillis and Contini 1966):
  segment lengths as shares of body height, from ground to crown.
- DIN 33402-2:2005, body heights of 18 to 65 year olds in Germany; ISO 7250-3 lists the same measure worldwide.
- Bohannon, Comfortable and maximum walking speed of adults aged 20-79 years, Age and Ageing 26, 1997.
- ISO 13855:2010, speeds at which safeguards are to expect people: walking 1.6 m/s, a hand 2.0 m/s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SKIN = (0.86, 0.66, 0.54, 1.0)
SHIRT = (0.20, 0.42, 0.62, 1.0)
TROUSERS = (0.23, 0.25, 0.30, 1.0)
SHOES = (0.12, 0.12, 0.13, 1.0)
CARDBOARD = (0.74, 0.56, 0.36, 1.0)

WALKING, REACHING = 1.6, 2.0  # speeds K that ISO 13855:2010 reckons with [m/s]
HURRYING = 2.5  # mean of the fastest walking of men in their twenties, the fastest group of Bohannon 1997 [m/s]

#: Body heights of the 5th, 50th and 95th percentile, DIN 33402-2:2005 [m].
HEIGHTS = {"women": (1.535, 1.625, 1.720), "men": (1.650, 1.750, 1.855)}

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


@dataclass(frozen=True)
class Body:
    """Lengths of one person. The default is the person of the first two experiments, 1.75 m tall, drawn by eye.

    That person's arms and trunk are 3 to 11 % shorter than Winter's; it stays as it is so that those experiments do.
    `Body.of_height` follows Winter.

    Attributes:
        height: [m].
        ankle: Height above the sole [m].
        shank, thigh, upper_arm, forearm: Between joints [m].
        hand: From the wrist to the grip, the far end of the hand's axis [m].
        hip, shoulder: Half of the distance between both joints [m].
        trunk: Height of the shoulders above the hips [m].
        head: Upper end of the head's axis above the hips [m].
        heel, toe: Behind and before the ankle, without the capsule's round ends [m].
    """

    height: float = 1.75
    ankle: float = 0.080
    shank: float = 0.420
    thigh: float = 0.420
    upper_arm: float = 0.290
    forearm: float = 0.250
    hand: float = 0.075
    hip: float = 0.090
    shoulder: float = 0.180
    trunk: float = 0.455
    head: float = 0.735
    heel: float = 0.055
    toe: float = 0.130

    @classmethod
    def of_height(cls, height: float) -> Body:
        """A person of a height [m] with Winter's proportions, fig. 4.1; thicknesses grow with the height."""
        scale = height / 1.75
        foot = 0.152 * height - 2.0 * 0.036 * scale  # the foot's length, without the capsule's round ends
        return cls(
            height=height,
            ankle=0.039 * height,
            shank=0.246 * height,  # knee 0.285 H above the ground
            thigh=0.245 * height,  # hip 0.530 H
            upper_arm=0.186 * height,
            forearm=0.146 * height,
            hand=0.108 * height - 0.033 * scale,  # to the fingertips, where the capsule ends
            hip=0.0955 * height - 0.072 * scale,  # breadth 0.191 H, of which the thighs' flesh
            shoulder=0.129 * height - 0.046 * scale,  # half breadth 0.129 H, of which the upper arm's flesh
            trunk=0.288 * height,  # shoulders 0.818 H above the ground
            head=(1.0 - 0.039 - LEG_USED * (0.246 + 0.245)) * height - 0.092 * scale,  # the crown at H
            heel=0.3 * foot,
            toe=0.7 * foot,
        )

    @property
    def scale(self) -> float:
        """Body height over 1.75 m."""
        return self.height / 1.75

    @property
    def foot_radius(self) -> float:
        """Of the foot's capsule: height of its axis above the sole [m]."""
        return 0.036 * self.scale

    @cached_property
    def frame(self) -> NDArray[np.float64]:
        """End points of torso, neck, head, pelvis and shoulders (5, 2, 3): root's frame, heights above the hips [m]."""
        up, s, head = self.trunk / 0.455, self.scale, self.head
        return np.array(
            [
                [[0.0, 0.0, 0.130 * up], [0.0, 0.0, 0.385 * up]],  # torso
                [[0.0, 0.0, 0.490 * up], [0.0, 0.0, head - 0.135 * s]],  # neck
                [[0.01 * s, 0.0, head - 0.085 * s], [0.01 * s, 0.0, head]],  # head
                [[0.0, -0.055 * s, 0.030 * s], [0.0, 0.055 * s, 0.030 * s]],  # pelvis
                [[0.0, -0.125 * s, self.trunk], [0.0, 0.125 * s, self.trunk]],  # shoulders
            ]
        )

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The 17 capsules: five of the trunk, then six of the left side, six of the right one."""
        trunk = np.linalg.norm(self.frame[:, 1] - self.frame[:, 0], axis=1)
        names = ("torso", "neck", "head", "pelvis", "shoulders")
        lengths = dict(zip(names, (round(float(length), 12) for length in trunk), strict=True))
        limbs = {
            "thigh": self.thigh,
            "shank": self.shank,
            "foot": self.heel + self.toe,
            "upper_arm": self.upper_arm,
            "forearm": self.forearm,
            "hand": self.hand,
        }
        for side in ("left", "right"):
            lengths |= {f"{side}_{name}": length for name, length in limbs.items()}
        found = []
        for name, length in lengths.items():
            kind = name.removeprefix("left_").removeprefix("right_")
            found.append(Segment(name, _RADII[kind] * self.scale, length, _COLOURS[kind]))
        return tuple(found)


_RADII = {
    "torso": 0.130,
    "neck": 0.050,
    "head": 0.092,
    "pelvis": 0.108,
    "shoulders": 0.068,
    "thigh": 0.072,
    "shank": 0.050,
    "foot": 0.036,
    "upper_arm": 0.046,
    "forearm": 0.037,
    "hand": 0.033,
}
_COLOURS = dict.fromkeys(("torso", "shoulders", "upper_arm"), SHIRT) | {
    "neck": SKIN,
    "head": SKIN,
    "forearm": SKIN,
    "hand": SKIN,
    "pelvis": TROUSERS,
    "thigh": TROUSERS,
    "shank": TROUSERS,
    "foot": SHOES,
}

FIRST = Body()
SEGMENTS: tuple[Segment, ...] = FIRST.segments
