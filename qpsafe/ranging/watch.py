"""Whether a sensor of many zones can be believed: the one place that decides what makes it sick.

An image is of no use if it does not fit its sensor, is older than the last one or than `max_age`, is from the future,
tells nothing in any zone, reads less than nothing anywhere, is frozen (the same to the last bit while the sensor, or
the robot before it, has moved), or sees through what is known (its rows are shifted, its optics are others, or it
hangs elsewhere). A sensor without a usable image for longer than `max_age` does not see; `dead_after` later it is dead
until acknowledged.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.reduction.nearest_kernel import same_numbers
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.ranging.reduction.reduce import Shown
    from qpsafe.ranging.rules import RangeRules
    from qpsafe.ranging.sensor import RangeSensor
    from qpsafe.sensing.rules import SensingRules

Array = NDArray[np.float64]

LATE = "late"  # after a newer one of the same sensor


class SensorWatch:
    """Watches one sensor.

    Args:
        sensor: The sensor.
        rules: Numbers for images.
        sensing: Times.

    Attributes:
        stamp: Of the last image that was taken [s]; -inf before the first.
        good: Of the last image that could be used [s].
        begin: Since when images are waited for [s].
        dead: Until acknowledged.
        late: How many images came after a newer one, and were left out.
    """

    def __init__(self, sensor: RangeSensor, rules: RangeRules, sensing: SensingRules) -> None:
        self._sensor, self._rules, self._sensing = sensor, rules, sensing
        self._patience = sensor.patience
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.stamp, self.good, self.begin = -inf, -inf, -inf
        self.dead, self.late, self._through = False, 0, 0
        self._last, self._where, self._since, self._same = np.empty(0), np.empty(0), inf, 0

    def acknowledge(self, now: float) -> None:
        """A person has looked: the sensor is trusted again if it sees."""
        self.dead = self.dead and self.silent(now)

    def too_old(self, stamp: float, now: float) -> str:
        """What is wrong with an image of this stamp; nothing: ''. One that came after a newer one is counted."""
        if stamp > now + self._sensing.clock_error:
            return f"from {stamp - now:.3g} s ahead: its clock is wrong"
        if now - stamp > self._patience:
            return f"stale, {now - stamp:.3g} s old"
        if stamp <= self.stamp:
            self.late += 1
            return LATE
        return ""

    def judged(self, stamp: float, distances: Array, shown: Shown, where: Array) -> str:
        """What is wrong with what an image shows; nothing: ''.

        Args:
            stamp: When it was taken [s].
            distances: Of its zones, or tiles (z,) [m].
            shown: What it shows.
            where: What has moved if an image has to be another one: poses of the sensor, or of the robot's bodies.
        """
        self.stamp = stamp
        wrong = ""
        if shown.impossible:
            wrong = f"{counted(shown.impossible, 'zone')} below zero"
        elif not shown.valid:
            wrong = "blind in all zones"
        elif self._is_frozen(stamp, distances, shown, where):
            wrong = "frozen"
        else:
            many = shown.expected >= self._rules.few and shown.through > self._rules.through * shown.expected
            self._through = self._through + 1 if many else 0
            if self._through >= self._rules.misplaced:
                wrong = f"sees through known things in {shown.through} of {shown.expected} zones: shifted or misplaced"
        if not wrong:
            self.good = stamp
        return wrong

    def _is_frozen(self, stamp: float, distances: Array, shown: Shown, where: Array) -> bool:
        same = shown.hits > 0 and same_numbers(distances, self._last)
        if not same:
            self._last, self._where, self._since, self._same = distances.copy(), where.copy(), stamp, 0
            return False
        self._same += 1
        if self._same < 2 or stamp - self._since < self._sensing.stuck_after:
            return False
        if self._sensor.mount == "world" and not shown.own:  # nothing before it needs to have moved
            return False
        return bool(np.abs(where - self._where).max(initial=0.0) >= self._sensing.stuck_motion)

    @property
    def seen(self) -> float:
        """Until when the sensor was known to see [s]: its last usable image, or when images were first waited for.

        The one that came first may have been old already.
        """
        return self.good if self.good > -inf else self.begin

    def silent(self, now: float) -> bool:
        """Whether nothing usable has come for too long."""
        return now - self.seen > self._patience

    def look(self, now: float) -> str:
        """What is wrong with the sensor now, in words; nothing: ''."""
        since = now - self.seen
        if since > self._patience + self._sensing.dead_after:
            self.dead = True
        if since > self._patience:
            never = "" if self.good > -inf else ", none yet"
            return f"without a usable image for {since:.2g} s{never}" + (", dead" if self.dead else "")
        return "dead until acknowledged" if self.dead else ""
