"""Speed and separation monitoring: how far away a person has to be, and how fast a robot may approach one.

With v_r the robot's speed towards the person, v_h the person's, T_r the reaction time, a_s the deceleration of a stop,
C the intrusion distance, Z_d and Z_r the uncertainty of the person's and the robot's place,

    S_p(v_r) = v_h (T_r + v_r/a_s) + v_r T_r + v_r²/(2 a_s) + C + Z_d + Z_r

is the protective separation distance of ISO/TS 15066 (5.5.4) for constant deceleration, and its exact inverse

    v_max(d) = sqrt(b² + 2 a_s (d - C - Z_d - Z_r - v_h T_r)) - b,   b = a_s T_r + v_h

the largest speed towards a person at distance d; 0 where d is below S_p(0).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError

_LARGEST = 1e100  # its square is a number, too


@dataclass(frozen=True)
class Separation:
    """Figures of speed and separation monitoring.

    Attributes:
        deceleration: a_s, the smallest deceleration of a stop that was measured [m/s²].
        person_speed: v_h, 1.6 for walking people, 2.0 for reaching hands (ISO 13855) [m/s].
        reaction_time: T_r, from what the sensor sees to the beginning of the stop [s].
        intrusion: C, how far a part of the body may be past what is detected [m]. ISO 13855 asks for 0.85 m where the
            sensor does not tell hands; the default 0 does not conform, as no sensor that sees 0.8 m far could.
        person_error, robot_error: Z_d, Z_r, errors of both places [m].

    Raises:
        ConfigurationError: A value is not finite or negative, or the deceleration is 0.
    """

    deceleration: float
    person_speed: float = 1.6
    reaction_time: float = 0.02
    intrusion: float = 0.0
    person_error: float = 0.02
    robot_error: float = 0.005

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            real = isinstance(value, int | float) and not isinstance(value, bool)
            if not (real and 0.0 <= value <= _LARGEST):
                raise ConfigurationError("Separation", item.name, value, "a finite number >= 0")
        if not self.deceleration > 0.0:
            raise ConfigurationError("Separation", "deceleration", self.deceleration, "a finite number > 0 [m/s²]")

    @property
    def standing(self) -> float:
        """S_p(0), the distance that even a robot at rest asks for [m]."""
        return self.person_speed * self.reaction_time + self.intrusion + self.person_error + self.robot_error

    def distance(self, speed: ArrayLike, held: float = 0.0) -> NDArray[np.float64]:
        """S_p for speeds of the robot towards the person, any shape [m/s]; speeds below 0 count as 0 [m].

        Args:
            speed: Towards the person, any shape [m/s].
            held: For how long it is kept before the stop can begin [s], see `speed`.
        """
        v, a_s, T_r = np.maximum(np.asarray(speed, dtype=float), 0.0), self.deceleration, self.reaction_time + held
        return self.standing + self.person_speed * v / a_s + v * T_r + v * v / (2.0 * a_s)

    def speed(self, distance: ArrayLike, held: float = 0.0) -> NDArray[np.float64]:
        """v_max for distances, any shape [m]; +inf where the distance is, 0 where it is not a number [m/s].

        Args:
            distance: To a person, any shape [m].
            held: For how long the speed is kept before another one can be commanded [s]: S_p(v_max) + v_max held = d,
                so that it is still admissible where it leads.
        """
        b = self.deceleration * (self.reaction_time + held) + self.person_speed
        room = np.asarray(distance, dtype=float) - self.standing
        room = np.where(room > 0.0, room, 0.0)  # false for NaN
        return np.maximum(np.sqrt(b * b + 2.0 * self.deceleration * room) - b, 0.0)  # b² may underflow
