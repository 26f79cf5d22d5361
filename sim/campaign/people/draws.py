"""A point of the unit cube as what one person does: which coordinate says what, and the numbers it stands for.

Every coordinate is turned by the inverse of a distribution function, so uniform points give people as the model has
them, and a search for the worst moves through all that the model allows. A coordinate that a kind of encounter does not
use has no effect there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from qpsafe.sim.campaign.people.tables import PeopleTable

#: Coordinates of the encounter, then those of each of two people.
SHARED = ("duration", "second")
PERSON = (
    *("kind", "azimuth", "speed", "height", "board", "delay", "start", "ease", "side", "near", "stay", "leave"),
    *("back", "arm", "along", "aside_x", "aside_y", "aside_z", "hand_speed", "early"),
)
NAMES = (*SHARED, *(f"{who}.{name}" for who in ("first", "second") for name in PERSON))
#: Those that choose between things: there, and only there, an encounter jumps (and `side`, at its middle).
CHOICES = frozenset(
    ("second", *(f"{who}.{name}" for who in ("first", "second") for name in ("kind", "board", "back", "arm")))
)


@dataclass(frozen=True)
class Draw:
    """What one person is like and does; m, m/s, s, rad.

    Attributes:
        kind: As in `Kinds`.
        azimuth: Direction from the robot's base axis to where they come from.
        speed: Walking.
        height: Of the body.
        board: Whether they carry one.
        delay: Before they set out.
        start: Where they are at full speed, beyond the robot's reach.
        ease: Time to stop for every m/s that they are fast [s^2/m].
        side: Closest approach of those who pass, to their left if positive, in shares of the reach.
        near: How near they come: before what stands there, to what they reach for, or from the base axis, in shares of
            the reach, to turn round.
        stay: How long.
        leave: Direction they leave into, beside the one they came from.
        back: Whether they leave walking backwards.
        left: Whether they reach with the left hand.
        along: Where on the robot they reach, 0 shoulder to 1 tool.
        aside: How far from that place, along x, y and z.
        hand_speed: Peak.
        late: How late that peak is.
        early: How long before they stand still the hand sets out.
        lean: Of a stumbling trunk [deg]; who falls farther, falls faster.
        turned: By how much they turn round, to the left if positive.
        turning: Peak rate of that [deg/s].
        leaving: Speed of walking away.
    """

    kind: str
    azimuth: float
    speed: float
    height: float
    board: bool
    delay: float
    start: float
    ease: float
    side: float
    near: float
    stay: float
    leave: float
    back: bool
    left: bool
    along: float
    aside: tuple[float, float, float]
    hand_speed: float
    late: float
    early: float
    lean: float
    turned: float
    turning: float
    leaving: float


def draw(model: PeopleTable, u: Sequence[float], azimuth: float, delay: float) -> Draw:
    """What the coordinates `PERSON` of one person stand for.

    Args:
        model: The file.
        u: 0 to 1, in the order of `PERSON`.
        azimuth: Where the person comes from [rad].
        delay: What is added to the person's own [s].
    """
    at = dict(zip(PERSON, u, strict=True))
    kind, walk, approach, hand = model.kind(at["kind"]), model.walk, model.approach, model.hand
    speed = model.speed(at["speed"])
    if kind == "inattentive":
        speed = max(walk.comfortable.at(at["speed"]) * walk.distracted.at(at["near"]), 0.5)
    elif kind == "stumble":
        speed = walk.comfortable.at(at["speed"])
    elif kind == "backwards":
        speed = walk.backwards.at(at["speed"])
    beside = abs(2.0 * at["side"] - 1.0)
    away = (approach.edge if kind == "inattentive" else approach.past).at(beside)
    nearness = {"stumble": model.stumble.stop, "reach": hand.stand, "turn": approach.turn}
    near = nearness.get(kind, approach.stop)
    return Draw(
        kind=kind,
        azimuth=azimuth,
        speed=speed,
        height=model.height(at["height"]),
        board=kind in ("past", "straight", "turn") and at["board"] < model.body.board.share,
        delay=approach.delay.at(at["delay"]) + delay,
        start=approach.start.at(at["start"]),
        ease=(model.stumble.ease if kind == "stumble" else walk.ease).at(at["ease"]),
        side=math.copysign(away, at["side"] - 0.5),
        near=near.at(at["near"]),
        stay=approach.stay.at(at["stay"]),
        leave=math.radians(approach.leave.at(at["leave"])),
        back=at["back"] < approach.backwards.share,
        left=at["arm"] < 0.5,
        along=hand.along.at(at["along"]),
        aside=(hand.aside.at(at["aside_x"]), hand.aside.at(at["aside_y"]), hand.aside.at(at["aside_z"])),
        hand_speed=(model.stumble.speed if kind == "stumble" else hand.speed).at(at["hand_speed"]),
        late=hand.late.at(at["hand_speed"]),
        early=(model.stumble.early if kind == "stumble" else hand.early).at(at["early"]),
        lean=model.stumble.lean.at(at["hand_speed"]),
        turned=math.copysign(math.radians(model.turn.angle.at(beside)), at["side"] - 0.5),
        turning=model.turn.rate.at(at["hand_speed"]),
        leaving=walk.comfortable.at(at["speed"]),
    )
