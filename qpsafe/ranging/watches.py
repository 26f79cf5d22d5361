"""The watches over all sensors of many zones: which of them do not see, and how many may fail."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from qpsafe.ranging.watch import SensorWatch
from qpsafe.sensing.detection import BadInput
from qpsafe.sensing.health import CAPPED, CLEAR, STOPPED

if TYPE_CHECKING:
    from qpsafe.ranging.rules import RangeRules
    from qpsafe.ranging.sensor import RangeSensor
    from qpsafe.sensing.rules import SensingRules

_ROUNDING = 1e-6  # of times, by far [s]


class Watches:
    """Watches sensors, and asks each only when it may have fallen silent.

    Args:
        sensors: The sensors.
        rules: Numbers for images.
        sensing: Times.
        most: How many may fail.

    Attributes:
        each: The watch of every sensor.
        unseen: Names of those that do not see now.
        stopped: Until acknowledged: too many are dead.
    """

    def __init__(self, sensors: Sequence[RangeSensor], rules: RangeRules, sensing: SensingRules, most: int) -> None:
        self._names, self.most = [sensor.name for sensor in sensors], most
        self.each = [SensorWatch(sensor, rules, sensing) for sensor in sensors]
        self._patience, self._seen = np.array([sensor.patience for sensor in sensors]), np.zeros(len(sensors))
        self.reset()

    @property
    def severity(self) -> str:
        """`clear`, `capped` or `stopped`, until acknowledged."""
        dead = self._doubted and any(watch.dead for watch in self.each)
        return STOPPED if self.stopped else CAPPED if dead else CLEAR

    def reset(self) -> None:
        """Forget everything."""
        for watch in self.each:
            watch.reset()
        self.unseen: tuple[str, ...] = ()
        self.stopped = self._doubted = False
        self._begin = True  # sensors are waited for from the next tick on
        self._until = -inf  # surely no sensor is silent before

    def acknowledge(self, now: float) -> None:
        """A person has looked: sensors that see again are trusted again, a stop they caused is lifted."""
        for watch in self.each:
            watch.acknowledge(now)
        self.stopped = sum(watch.dead for watch in self.each) > self.most

    def saw(self, who: int, stamp: float) -> None:
        """A sensor has sent a usable image [s]."""
        self._seen[who] = stamp

    def look(self, now: float) -> list[str]:
        """Which sensors do not see at a time [s], in words.

        Raises:
            BadInput: Too many.
        """
        if self._begin:
            for watch in self.each:
                watch.begin = now
            self._seen[:], self._begin, self._until = [watch.seen for watch in self.each], False, -inf
        if not (self._doubted or now > self._until):
            return []
        self._until = float((self._seen + self._patience).min()) - _ROUNDING  # images that came since put it off
        if not (self._doubted or (now - self._seen > self._patience).any()):
            return []
        kinds: dict[str, list[str]] = {}
        unseen = []
        for name, watch in zip(self._names, self.each, strict=True):
            what = watch.look(now)
            if what:
                kinds.setdefault(what, []).append(name)
                unseen.append(name)
        self.unseen, self._doubted = tuple(unseen), bool(unseen)
        if not unseen:
            return []
        self.stopped |= sum(watch.dead for watch in self.each) > self.most
        notes = [f"range sensors {what}, unseen what is before them: {', '.join(who)}" for what, who in kinds.items()]
        if self.stopped or len(unseen) > self.most:
            more = "stopped until acknowledged" if self.stopped else "stopped until they see again"
            raise BadInput("; ".join((f"more than {self.most} range sensors do not see: {more}", *notes)))
        return notes
