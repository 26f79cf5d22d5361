"""What is unusual about a robot's compiled tick, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from qpsafe.batch import code
from qpsafe.batch.blocks import Own
from qpsafe.gate.gated import TOO_LONG, TOO_NEAR
from qpsafe.recovery.stall import TEXTS
from qpsafe.sensing.health import HEALTHY, WORDS

if TYPE_CHECKING:
    from collections.abc import Sequence

_REASONS = {
    code.NO_MEASUREMENT: "q or qd is no measurement: not finite, or too far outside the limits",
    code.NOTHING_GIVEN: "neither distances nor points are given",
    code.NO_SPOTS: "distances are given but the robot has no spots",
    code.WRONG_SIZE: "more points than there is room for, or not one distance and one age a spot",
    code.OUT_OF_ORDER: "too many spots are out of order: stopped",
    code.POINT_NOT_FINITE: "a point is not finite",
    code.DANGER_NOT_FINITE: "the danger of a point is not finite: joint values or points are out of all bounds",
    code.LAW_ABSURD: "ValueError: the law returned a velocity that is not finite or absurd",
    code.PATH_UNKNOWN: "the path's clock is beyond what was looked at of a trajectory: give a larger horizon",
}
_NOTES = {
    code.LIMIT_GAVE_WAY: "a joint limit was sacrificed for another one",
    code.LAW_EXCEEDED: "the law exceeded the limits, clipped",
    code.NOT_SOLVED: "law: not solved as planned",
    code.TOO_NEAR: TOO_NEAR,
    code.TOO_LONG: TOO_LONG,
    code.ODD_UNITS: "readings or points too far away to be metres; +inf where nothing is in sight",
}


def words_of(own: Own, spots: Sequence[bool], names: Sequence[str]) -> tuple[str, ...]:
    """Sentences about a robot's tick.

    Args:
        own: Its arrays after the tick.
        spots: Which of its spots are dead (k,).
        names: Of the spots.
    """
    reason, notes = int(own.marks[code.REASON]), int(own.marks[code.NOTES])
    said = [TEXTS[notes // code.STALL]] if notes >= code.STALL else []
    said += [text for bit, text in _NOTES.items() if notes & bit]
    if reason:
        said = [_REASONS[reason]]
    if reason == code.OUT_OF_ORDER or notes & code.SENSORS_SICK:
        for k, name in enumerate(names):
            sick = own.counts[k, 0]
            if spots[k] or sick != HEALTHY:
                said.append(f"spot {name}, unseen what is before it: {'dead' if spots[k] else WORDS[sick]}")
    return tuple(said)
