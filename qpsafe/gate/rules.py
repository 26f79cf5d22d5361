"""What a verified motion assumes and asks for: all figures in one place."""

from __future__ import annotations

import math

import numpy as np

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.text.words import call


class VerifiedMotion(Fixed):
    """Figures of the gate, the last step of a tick.

    A person whose nearest point was seen at p can be anywhere in a ball around p, whose radius at time t from now is

        R(t) = person_error + person_speed (t + age + latency + servo_lag).

    Args:
        person_speed: v_h, the fastest that anybody comes [m/s]: 1.6 for walking people (ISO 13855), 2.0 for hands.
        latency: T_r, from what a sensor sees to the reference that answers it [s]. One tick of sensing, one of the
            network, and what the controller filters; ours.
        servo_lag: How far the robot is behind its references [s]; EGM's is 0.010 to 0.020.
        person_error: ρ, error of a seen point [m]. The Sharp's calibrated one at 0.8 m; ours.
        approach: v_s, how fast a link may approach somebody whom it could touch [m/s]. Slow enough that a contact
            stays below every energy limit with an effective mass of 100 kg: ½ 100 · 0.05² = 0.13 J; ours.
        sidestep: For how long a person may go anywhere, sideways too, between what was seen and what is seen next [s]:
            nobody within `person_speed` times this of a seen point is approached. 4 cm, ours: more keeps the robot
            from those who step round a link between two readings of slow sensors (of Sharps 6 cm), and from getting
            out of the way sideways. With infinity nobody is approached wherever they could have gone to by the time
            the robot stands: the strictest promise, which near people allows hardly any motion, going away included.
        escape: A link that, from rest, could not get away from who is near at this speed within 0.1 s stands still
            before it can be touched [m/s]: the turntable, the foot of the lower arm. 0: it goes on, and is touched
            while it moves, sideways for the most part. On the IRB 140 the foot of the lower arm is such a link; ours.
        margin: Distance to furniture, floor and other links that is kept [m]. Between the instants looked at the
            distance stays above half of it. More than a reference interpolated over a tick leaves it by; ours.

    Raises:
        ConfigurationError: A number is negative, or not finite (only `sidestep` may be infinite), or `approach` or
            `margin` is 0.
    """

    def __init__(
        self, person_speed: float = 1.6, *, latency: float = 0.02, servo_lag: float = 0.0, person_error: float = 0.02,
        approach: float = 0.05, margin: float = 0.004, sidestep: float = 0.025, escape: float = 0.2,
    ) -> None:  # fmt: skip
        given = {
            "person_speed": person_speed, "latency": latency, "servo_lag": servo_lag, "person_error": person_error,
            "approach": approach, "margin": margin, "sidestep": sidestep, "escape": escape,
        }  # fmt: skip
        for key, value in given.items():
            positive = key in ("approach", "margin")
            try:
                number = float(value)
            except (TypeError, ValueError, OverflowError):
                number = math.nan
            enough = number > 0.0 if positive else number >= 0.0
            if (
                isinstance(value, str | bytes | bool | np.bool_)
                or not enough
                or not (number < math.inf or key == "sidestep")
            ):
                kind = "number" if key == "sidestep" else "finite number"
                raise ConfigurationError("VerifiedMotion", key, value, f"a {kind} {'> 0' if positive else '>= 0'}")
            setattr(self, key, number)

    person_speed: float
    latency: float
    servo_lag: float
    person_error: float
    approach: float
    margin: float
    sidestep: float
    escape: float

    def __repr__(self) -> str:
        rest = {key: getattr(self, key) for key in self.__annotations__ if key != "person_speed"}
        return call(self, self.person_speed, **rest)

    def radius(self, time: float, age: float = 0.0) -> float:
        """R(t) of the ball that somebody can reach [m].

        Args:
            time: t, from now [s].
            age: Of the reading [s].
        """
        return self.person_error + self.person_speed * (time + age + self.latency + self.servo_lag)
