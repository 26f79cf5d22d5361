"""The sensors of a controller: spots on its skin, and what takes images; trusted, doubted, and trusted again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from qpsafe.errors import ConfigurationError
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.ranging.ranged import PERSON
from qpsafe.sensing.health import CAPPED, CLEAR, STOPPED
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing, check_surroundings
from qpsafe.sensing.skin.spots import SpotArray, load_spots
from qpsafe.sensing.units import UnitWatch

if TYPE_CHECKING:
    from qpsafe.ranging.ranging import RangeSensing
    from qpsafe.ranging.rules import RangeRules
    from qpsafe.ranging.sensor import RangeSensor
    from qpsafe.robot.robot import Robot


_NONE: tuple[str, ...] = ()


class Sensors:
    """What a `SafetyController` sees with; given at construction."""

    _robot: Robot
    _dt: float
    _seq: int
    _gate: VerifiedMotion | None
    _spots: SpotArray | None
    _rules: SensingRules
    _sensing: DistanceSensing | None
    _ranging: RangeSensing | None
    _units: UnitWatch
    _known: tuple[Obstacle, ...]
    _carried: Mapping[str, Sequence[Obstacle]] | None

    def _set_sensors(
        self, spots: SpotArray | str | None, rules: SensingRules | None, range_sensors: Sequence[RangeSensor],
        ranging: RangeRules | None, known: Sequence[Obstacle], carried: Mapping[str, Sequence[Obstacle]] | None,
    ) -> None:  # fmt: skip
        robot = self._robot
        self._spots = checked_spots(spots, robot)
        self._rules = SensingRules(**dict(robot.tuned.sensing)) if rules is None else rules
        check_surroundings(robot, self._rules, known, carried)
        self._known = tuple(known)
        self._carried = carried = None if carried is None else {frame: tuple(it) for frame, it in carried.items()}
        self._sensing = self._ranging = None
        if self._spots is not None:
            self._sensing = DistanceSensing(robot, self._spots, self._dt, self._rules, known, carried)
        self._units = UnitWatch(self._spots, self._dt)
        others = 0 if self._spots is None else len(self._spots)
        self._ranging = checked_ranging(range_sensors, ranging, (robot, self._rules, known, carried, others))

    @property
    def spots(self) -> SpotArray | None:
        """The distance sensors."""
        return self._spots

    @property
    def rules(self) -> SensingRules:
        """What counts as danger, and what sick sensors do."""
        return self._rules

    @property
    def sensing(self) -> DistanceSensing | None:
        """The distance sensors with what they remember."""
        return self._sensing

    @property
    def ranging(self) -> RangeSensing | None:
        """The sensors of many zones with what they remember."""
        return self._ranging

    @property
    def range_sensors(self) -> tuple[RangeSensor, ...]:
        """The sensors of many zones."""
        return () if self._ranging is None else tuple(self._ranging.sensors)

    @property
    def known(self) -> tuple[Obstacle, ...]:
        """Known obstacles of the surroundings."""
        return self._known

    @property
    def carried(self) -> Mapping[str, tuple[Obstacle, ...]]:
        """What tools may carry, by frame."""
        return MappingProxyType({frame: tuple(things) for frame, things in (self._carried or {}).items()})

    def acknowledge(self) -> None:
        """A person has seen to the sensors: those that work again are trusted again, a stop they caused is lifted."""
        for part in (self._sensing, self._ranging, self._units):
            if part is not None:
                part.acknowledge()

    def _reset_sensors(self) -> None:
        for part in (self._sensing, self._ranging, self._units):
            if part is not None:
                part.reset()

    def _unseen(self) -> tuple[str, tuple[str, ...]]:
        """At the end of every tick: severity of sick sensors, and names of those that cannot be trusted now."""
        severity, names = CLEAR, _NONE
        if self._sensing is not None:
            severity, names = self._sensing.health.severity, self._sensing.unseen
        if self._ranging is not None:
            self._ranging.inbox.keep()
            severity = max(severity, self._ranging.watches.severity, key=(CLEAR, CAPPED, STOPPED).index)
            names = (*names, *self._ranging.watches.unseen)
        return severity, tuple(dict.fromkeys((*names, *self._units.odd))) if self._units.odd else names

    def _receive(self, images: Any) -> None:
        """Keep images, whatever else is wrong with this tick: nobody sends them twice."""
        if self._ranging is not None and images is not None:
            self._ranging.inbox.put(images)

    def _clock(self, now: float | None) -> float:
        """Present time on the clock of stamps [s]."""
        return (self._seq + 1) * self._dt if now is None else now

    @property
    def _person_speed(self) -> float:
        """How fast people come [m/s]."""
        return PERSON if self._gate is None else self._gate.person_speed


def checked_spots(spots: SpotArray | str | None, robot: Robot) -> SpotArray | None:
    """The robot's own spots, none, or those given, if this robot can carry them."""
    if spots is None:
        return load_spots(robot)
    if isinstance(spots, str) and spots == "off":
        return None
    if not isinstance(spots, SpotArray):
        expected = 'a SpotArray, e.g. qpsafe.load_spots(robot), or "off"'
        raise ConfigurationError("SafetyController", "spots", spots, expected)
    spots.check(robot)
    return spots


def checked_ranging(sensors: Any, rules: Any, parts: tuple[Any, ...]) -> RangeSensing | None:
    """Sensors of many zones; None where there are none.

    Args:
        sensors: As given.
        rules: As given.
        parts: Robot, sensing rules, known obstacles, carried ones, how many spots.
    """
    if isinstance(sensors, Sequence) and not isinstance(sensors, str) and len(sensors) == 0 and rules is None:
        return None
    from qpsafe.ranging.ranging import RangeSensing  # compiled when it is asked for
    from qpsafe.ranging.rules import RangeRules

    if not (rules is None or isinstance(rules, RangeRules)):
        raise ConfigurationError("SafetyController", "ranging", rules, "RangeRules")
    robot, sensing, known, carried, others = parts
    return RangeSensing(robot, sensors, sensing, rules, known, carried, others)
