"""Figures of an EGM session: how references are ramped in and out, and what counts as wrong."""

from __future__ import annotations

from dataclasses import dataclass, fields

from qpsafe.errors import ConfigurationError
from qpsafe.text.given import number, whole


@dataclass(frozen=True)
class SessionRules:
    """How an `EgmSession` drives a robot.

    Attributes:
        ramp_in: How long references are blended in, from the measured pose on [s].
        ramp_out: How long a stop takes at least; longer where the joints cannot brake as quickly [s].
        deviation: How far the robot may be from what it was sent within the last `lag` [rad].
        lag: The longest delay of robot and wire that counts as normal; EGM itself has 10 to 20 ms [s].
        jump: How much farther than at its highest speed a joint's reference may move from one tick to the next [rad].
        catch_up: Highest speed to make up for references that were not followed, as a fraction of each joint's highest.
        silence: After this long without a packet the robot may come back from another port, or with an older clock [s].
        most_missed: With more packets missing than this, their numbers mean a restart.
        margin: How far outside its limits a measured joint can be believed to be [rad].

    Raises:
        ConfigurationError: A figure is not finite or not positive, or `most_missed` is no whole number.
    """

    ramp_in: float = 0.5
    ramp_out: float = 0.2
    deviation: float = 0.1
    lag: float = 0.1
    jump: float = 0.02
    catch_up: float = 0.1
    silence: float = 1.0
    most_missed: int = 15000
    margin: float = 0.5

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name != "most_missed":
                number("SessionRules", field.name, getattr(self, field.name), "a finite number > 0", above=0.0)
        whole("SessionRules", "most_missed", self.most_missed, "a whole number, 1 to 2^31 - 1", 1, 2**31 - 1)
        if not self.catch_up <= 1.0:
            raise ConfigurationError("SessionRules", "catch_up", self.catch_up, "a fraction <= 1")
