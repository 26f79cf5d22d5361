"""Friction of the evasion counts only where it is known how fast what images show comes nearer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.danger.evasion import Evasion
from qpsafe.ranging.sensor import RangeSensor


class Own:
    """A field of another making: it is shown points at rest."""

    def __init__(self) -> None:
        self._usual = qpsafe.DangerField()

    def evaluate(self, *given: Any) -> Any:
        return self._usual.evaluate(*given)


def evaded(run: Any, eyes: Any, friction: float, speed: float, **parts: Any) -> tuple[np.ndarray, bool]:
    """q̇0 of every tick while a ball comes at the tool [m/s], and whether a point was seen all that time."""
    robot = qpsafe.load_robot("irb140")
    tcp = robot.pose("tcp", robot.home)[:3, 3]
    sensor = RangeSensor.array("array", pose=eyes.looking(tuple(tcp), tuple(tcp + np.array([2.0, 0.3, 0.3]))))
    rule = Evasion.for_robot(robot, 0.004)
    evasion = Evasion(rule.mass, rule.damping, robot.nq, 0.004, friction * rule.friction)
    loop = run(spots="off", range_sensors=[sensor], evasion=evasion, gate="off", **parts)
    place, found, seen = sensor.pose, [], False
    for k in range(round(0.8 / speed / 0.004)):
        images = []
        if k % 8 == 0:
            ball = (tcp[0] + 1.1 - speed * 0.004 * k, tcp[1], tcp[2], 0.15)
            images = [sensor.image(eyes.seen(sensor, place, [ball]), stamp=0.004 * k)]
        tick = loop.feed(robot.home, np.zeros(robot.nq), images=images, now=0.004 * k)
        found.append(tick.qd0)
        seen |= len(tick.points) > 0
    return np.array(found), seen


UNKNOWN: dict[str, Any] = {
    "not tracked": lambda: {"ranging": qpsafe.RangeRules(predict=False)},
    "a field of another making": lambda: {"field": Own()},
    "no velocities": lambda: {"sensing": qpsafe.SensingRules(velocities=False)},
}


@pytest.mark.parametrize("why", UNKNOWN)
def test_where_nobodys_speed_is_known_there_is_no_friction(run: Any, eyes: Any, why: str) -> None:
    """Somebody at 1.6 m/s was taken for one who stands: six sevenths of the evasion were lost."""
    (rubbed, seen), (free, _) = (evaded(run, eyes, c, 1.6, **UNKNOWN[why]()) for c in (1.0, 0.0))
    assert seen
    assert np.abs(free).max() > 0.1
    np.testing.assert_allclose(rubbed, free, rtol=1e-9, atol=1e-12)


def test_where_it_is_known_who_stands_moves_nobody(run: Any, eyes: Any) -> None:
    """The same images, tracked: with enough friction the arm rests before who creeps, and flees who comes."""
    for speed, moves in ((0.05, False), (1.6, True)):
        rubbed, seen = evaded(run, eyes, 4.0, speed)
        assert seen
        assert bool(np.abs(rubbed).max() > 0.3) is moves
