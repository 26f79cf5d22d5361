"""What a person does with arms, back and head: where the hands are, and how far it takes to stoop.

An arm that reaches is one line from the shoulder through the grip: the hand continues the forearm. Where an arm is too
short for what is asked, the back bends forwards, up to `LEAN`, and for low things the knees bend too, by as little as
brings the hands there. Points are in the root's frame: on the floor below the pelvis, x forward, y left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import Body

Array = NDArray[np.float64]
Point = tuple[float, float, float]

LEAN = math.radians(60.0)  # how far the back bends
CROUCH = 0.40  # how far bending knees lower the hips of somebody 1.75 m tall [m]
ARM_USED = 0.985  # of an arm's length when it is stretched, so that the elbow knows where to bend
STRETCHED = 0.993  # of an arm's length that it never exceeds, however it moves
SWING = 0.55  # swing of a hanging arm, in radians per metre that the opposite foot is ahead

HANG = "hang"  # an arm's goal: hanging at the side
EDGE = "edge"  # an arm's goal: the edge of the board, where it is held


class Arm(NamedTuple):
    """One arm on its way from a goal to another; a goal is a point that the grip is to reach, `HANG` or `EDGE`.

    Attributes:
        start, goal: Where it comes from, where it goes.
        share: Of the way that is done, 0 to 1.
        lift: How much higher than on the straight way the hand is in the middle of it [m].
    """

    start: Point | str = HANG
    goal: Point | str = HANG
    share: float = 1.0
    lift: float = 0.0


class Stoop(NamedTuple):
    """How far the back is bent forwards [rad], and the knees, by how much the hips are lower [m]."""

    lean: float = 0.0
    crouch: float = 0.0


class Posture(NamedTuple):
    """What a person does besides standing or walking.

    Attributes:
        arms: Left and right.
        stoop: Of back and knees.
        hold: Distance of the board's face from the root, and height of its middle above the floor, where the hands
            hold it or last held it [m]; None for the board's own figures.
        resting: Where the board stands when it is not held: x, y [m] of its face's middle and heading [rad] in the
            world, height of its middle above the floor [m]; None while it is held.
        gaze: Tilt of the head forwards and to the left [rad].
    """

    arms: tuple[Arm, Arm] = (Arm(), Arm())
    stoop: Stoop = Stoop()
    hold: tuple[float, float] | None = None
    resting: tuple[float, float, float, float] | None = None
    gaze: tuple[float, float] = (0.0, 0.0)


def place_hands(
    body: Body, hip: float, stoop: Stoop, swings: Sequence[float], arms: Sequence[Arm], edges: Array
) -> tuple[Array, Array, Array]:
    """Shoulders, wrists and grips of both arms, (2, 3) each.

    Args:
        body: Whose.
        hip: Height of the hips when upright [m].
        stoop: Of back and knees.
        swings: How far the foot opposite to each arm is ahead of the root [m].
        arms: Left and right.
        edges: Where the wrists would hold the board, and the direction of the fingers there in the last row (3, 3).
    """
    shoulders = _shoulders(body, hip, stoop)
    wrists, grips = np.empty((2, 3)), np.empty((2, 3))
    for i, arm in enumerate(arms):
        grips[i] = _grip(body, shoulders[i], arm, edges[i] + body.hand * edges[2], 1 - 2 * i, swings[i])
        held = (1.0 - arm.share) * (arm.start == EDGE) + arm.share * (arm.goal == EDGE)
        along = grips[i] - shoulders[i]
        direction = (1.0 - held) * along / max(math.hypot(*along), 1e-9) + held * edges[2]
        wrists[i] = grips[i] - body.hand * direction / math.hypot(*direction)
        line = wrists[i] - shoulders[i]
        length = math.hypot(*line)
        excess = length - STRETCHED * (body.upper_arm + body.forearm)
        if excess > 0.0:  # on its way the hand stays with the arm
            grips[i] -= excess / length * line
            wrists[i] -= excess / length * line
    return shoulders, wrists, grips


def _shoulders(body: Body, hip: float, stoop: Stoop) -> Array:
    x, z = body.trunk * math.sin(stoop.lean), hip - stoop.crouch + body.trunk * math.cos(stoop.lean)
    return np.array([[x, body.shoulder, z], [x, -body.shoulder, z]])


def _grip(body: Body, shoulder: Array, arm: Arm, edge: Array, side: int, swing: float) -> Array:
    """Where the grip of one arm is."""
    angle, out = SWING * swing + 0.06, 0.10
    length = 0.97 * (body.upper_arm + body.forearm) + body.hand
    flat = length * math.cos(out)
    hanging = shoulder + np.array([flat * math.sin(angle), side * length * math.sin(out), -flat * math.cos(angle)])
    places = {HANG: hanging, EDGE: edge}
    a, b = (places[goal] if isinstance(goal, str) else np.array(goal) for goal in (arm.start, arm.goal))
    grip: Array = (1.0 - arm.share) * a + arm.share * b
    grip[2] += 4.0 * arm.share * (1.0 - arm.share) * arm.lift
    return grip


def least_stoop(body: Body, hip: float, goals: Sequence[Point | str], edges: Array) -> tuple[Stoop, float]:
    """The least stoop with which both hands are at their goals, and how much the arms are too short even so [m].

    Args:
        body: Whose.
        hip: Height of the hips when upright [m].
        goals: Of left and right arm.
        edges: As in `place_hands`.
    """
    heights = [9.0 if goal == HANG else edge[2] if isinstance(goal, str) else goal[2]
               for goal, edge in zip(goals, edges, strict=False)]  # fmt: skip
    low = min(1.2 * max(0.75 * hip - min(heights), 0.0), CROUCH * body.scale)  # the lower a hand goes, the more

    def stoop(share: float) -> Stoop:
        return Stoop(share * LEAN, share * share * low)

    def lacking(share: float) -> float:
        shoulders, most = _shoulders(body, hip, stoop(share)), -math.inf
        for i, goal in enumerate(goals):
            if goal != HANG:
                length = math.dist(edges[i], shoulders[i]) if isinstance(goal, str) else math.dist(goal, shoulders[i])
                most = max(most, length - (0.0 if isinstance(goal, str) else body.hand))
        return most - ARM_USED * (body.upper_arm + body.forearm)

    share = _least(lacking)
    return stoop(share), max(lacking(share), 0.0)


def _least(lacking: Callable[[float], float]) -> float:
    """The least share from 0 to 1 with which nothing is lacking, or that with which least is."""
    tries = [(k / 40, lacking(k / 40)) for k in range(41)]
    good = [k for k, (_, value) in enumerate(tries) if value <= 0.0]
    if not good:
        return min(tries, key=lambda item: item[1])[0]
    if good[0] == 0:
        return 0.0
    low, high = tries[good[0] - 1][0], tries[good[0]][0]
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if lacking(middle) <= 0.0 else (middle, high)
    return high
