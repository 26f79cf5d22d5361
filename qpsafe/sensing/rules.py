"""Every number that decides which measurement counts, in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass

from qpsafe.errors import ConfigurationError
from qpsafe.text.given import LARGEST


@dataclass(frozen=True)
class SensingRules:
    """What counts as danger, and what happens when a sensor is sick; docs/reference/sensing.md has the table.

    Attributes:
        d_min: A measurement below this always counts, known obstacle or not [m]. Above 0.15 m, where the Sharp sensor
            turns back, so that what it reads as too near counts; below what the spots see of the robot itself.
        tolerance: How far before the surface of a known obstacle or of the robot itself a point is still taken for it,
            plus the radius of the spot's cone there [m].
        self_detection: Whether points on the robot itself are left out.
        hold_time: How long what a spot saw still counts when it is lost or something farther is read [s].
        approach_speed: Of the held point towards its spot meanwhile, until it is d_min from the robot's wire; the
            walking speed of ISO 13855 [m/s].
        jump: A reading this much farther than the one before is another thing, not the same one going away [m].
        max_age: An older reading is stale [s].
        clock_error: An age below minus this, or one that has grown by a tick and more than this since the last tick,
            is impossible: the clock that it was taken by is wrong [s].
        stuck_after: A spot is stuck whose reading stays the same, to the last bit, for this long [s] ...
        stuck_motion: ... while the point it means moves this far with the robot [m].
        dead_after: A spot without a usable reading for this long is dead until acknowledged [s].
        dead_share: With more than this share of the spots unusable the robot stops.
        speed_cap: Largest speed of any point of the wire while a spot is dead, the reduced speed of ISO 10218 [m/s].
        velocities: Whether the approach of obstacles is estimated and fed to the kinetic field; in the paper they stand
            still.

    Raises:
        ConfigurationError: A value is not finite or out of range.
    """

    d_min: float = 0.16
    tolerance: float = 0.02
    self_detection: bool = True
    hold_time: float = 0.15
    approach_speed: float = 1.6
    jump: float = 0.05
    max_age: float = 0.04
    clock_error: float = 0.01
    stuck_after: float = 0.1
    stuck_motion: float = 0.02
    dead_after: float = 0.02
    dead_share: float = 0.2
    speed_cap: float = 0.25
    velocities: bool = True

    def __post_init__(self) -> None:
        for key in ("d_min", "tolerance", "approach_speed", "jump", "stuck_motion"):
            self._check(key, 0.0, math.inf, "a finite number >= 0")
        for key in ("hold_time", "max_age", "clock_error", "stuck_after", "dead_after"):
            self._check(key, 0.0, 3600.0, "a time, 0 to 3600 s")
        self._check("dead_share", 0.0, 1.0, "a share, 0 to 1")
        self._check("speed_cap", math.ulp(0.0), math.inf, "a finite speed > 0 [m/s]")
        for key in ("self_detection", "velocities"):
            if not isinstance(getattr(self, key), bool):
                raise ConfigurationError("SensingRules", key, getattr(self, key), "True or False")

    def _check(self, key: str, least: float, most: float, expected: str) -> None:
        value = getattr(self, key)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and abs(value) <= LARGEST and least <= value <= most):  # of NaN false
            raise ConfigurationError("SensingRules", key, value, expected)

    @staticmethod
    def ticks(time: float, dt: float) -> int:
        """A time of these rules in whole ticks."""
        return round(time / dt)
