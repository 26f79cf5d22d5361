"""What a person does with arms, back and head: where the hands are, and how far it takes to stoop.

An arm that reaches is one line from the shoulder through the grip: the hand continues the forearm. Where an arm is too
short for what is asked, the back bends forwards, up to `LEAN`, and for low things the knees bend too, by as little as
brings the hands there. Points are in the root's frame: on the floor below the pelvis, x forward, y left, z up.

Where a grip is to be, is a sum: so much of where a hanging hand is, so much of where the board is held, and a point. So
a way from any of them to any other is a line between two rows of numbers; `goal_row` makes them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import Body
from qpsafe.sim.people.limbs import length

Array = NDArray[np.float64]
Point = tuple[float, float, float]

LEAN = math.radians(60.0)  # how far the back bends
CROUCH = 0.40  # how far bending knees lower the hips of somebody 1.75 m tall [m]
ARM_USED = 0.985  # of an arm's length when it is stretched, so that the elbow knows where to bend
STRETCHED = 0.993  # of an arm's length that it never exceeds, however it moves
SWING = 0.55  # swing of a hanging arm, in radians per metre that the opposite foot is ahead
FINGERS = np.array([math.cos(0.18), 0.0, math.sin(0.18)])  # at the board, from the wrist forwards and a little up

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


class Postures(NamedTuple):
    """`Posture` at T times, or at one (T = 1) for all times.

    Attributes:
        arms: Rows of left and right arm as `goal_row` has them (T, 2, 5).
        stoop: Lean [rad] and crouch [m] (T, 2).
        gaze: (T, 2) [rad].
        hold: (T, 2) [m], or None for the board's own figures.
        resting: (T, 4), not finite where the board is held; or None if it always is.
    """

    arms: Array
    stoop: Array
    gaze: Array
    hold: Array | None = None
    resting: Array | None = None

    @classmethod
    def of(cls, posture: Posture) -> Postures:
        """One posture."""
        rows = [between(goal_row(arm.start), goal_row(arm.goal), arm.share, arm.lift) for arm in posture.arms]
        return cls(
            np.array([rows]),
            np.array([posture.stoop]),
            np.array([posture.gaze]),
            None if posture.hold is None else np.array([posture.hold]),
            None if posture.resting is None else np.array([posture.resting]),
        )


def goal_row(goal: Point | str) -> Array:
    """A goal as (5,): share of the hanging hand, share of the board's edge, point [m]."""
    return np.array((0.0, 0.0, *goal) if not isinstance(goal, str) else (goal == HANG, goal == EDGE, 0.0, 0.0, 0.0))


def between(a: Array, b: Array, share: Array | float, lift: Array | float = 0.0) -> Array:
    """Rows on the way from goal to goal.

    Args:
        a: Row of the start (..., 5).
        b: Of the goal.
        share: Of the way that is done (..., 1) or a number.
        lift: How much higher than on the straight way in the middle of it [m], likewise.
    """
    row: Array = (1.0 - share) * a + share * b
    row[..., 4:5] += 4.0 * share * (1.0 - share) * lift
    return row


def place_hands(body: Body, hip: Array, postures: Postures, swings: Array, edges: Array) -> tuple[Array, Array, Array]:
    """Shoulders, wrists and grips of both arms at T times, (T, 2, 3) each.

    Args:
        body: Whose.
        hip: Height of the hips when upright (T,) [m].
        postures: What arms, back and knees do.
        swings: How far the foot opposite to each arm is ahead of the root (T, 2) [m].
        edges: Where the wrists would hold the board (T, 2, 3).
    """
    arms, stoop, side = postures.arms, postures.stoop, np.array([1.0, -1.0])
    shoulders = place_shoulders(body, hip, stoop[:, 0], stoop[:, 1])
    angle, out = SWING * swings + 0.06, 0.10
    whole = 0.97 * (body.upper_arm + body.forearm) + body.hand
    flat, wide = whole * math.cos(out), np.broadcast_to(side * whole * math.sin(out), angle.shape)
    hanging = shoulders + np.stack((flat * np.sin(angle), wide, -flat * np.cos(angle)), axis=-1)
    held = arms[..., 1:2]
    grips = arms[..., :1] * hanging + held * (edges + body.hand * FINGERS) + arms[..., 2:]
    along = grips - shoulders
    direction = (1.0 - held) * along / np.maximum(length(along), 1e-9) + held * FINGERS
    wrists = grips - body.hand * direction / length(direction)
    line = wrists - shoulders
    far = length(line)
    back = np.maximum(far - STRETCHED * (body.upper_arm + body.forearm), 0.0) / far * line
    return shoulders, wrists - back, grips - back  # on its way the hand stays with the arm


def place_shoulders(body: Body, hip: Array | float, lean: Array, crouch: Array) -> Array:
    """Left and right shoulder (..., 2, 3) [m].

    Args:
        body: Whose.
        hip: Height of the hips when upright (...) [m].
        lean: Of the back (...) [rad].
        crouch: Of the knees (...) [m].
    """
    x, z = np.broadcast_arrays(body.trunk * np.sin(lean), hip - crouch + body.trunk * np.cos(lean))
    return np.stack([np.stack((x, np.full_like(x, y), z), axis=-1) for y in (body.shoulder, -body.shoulder)], axis=-2)


def least_stoop(body: Body, hip: float, goals: Sequence[Point | str], edges: Array) -> tuple[Stoop, float]:
    """The least stoop with which both hands are at their goals, and how much the arms are too short even so [m].

    Args:
        body: Whose.
        hip: Height of the hips when upright [m].
        goals: Of left and right arm.
        edges: Where the wrists would hold the board (2, 3).
    """
    wanted = [i for i, goal in enumerate(goals) if goal != HANG]
    if not wanted:
        return Stoop(), 0.0
    # where wrists, or grips, are to be, and how far from the shoulder that may be
    points = np.array([edges[i] if isinstance(goals[i], str) else goals[i] for i in wanted])
    reach = ARM_USED * (body.upper_arm + body.forearm)
    most = np.array([reach if isinstance(goals[i], str) else reach + body.hand for i in wanted])
    low = min(1.2 * max(0.75 * hip - float(points[:, 2].min()), 0.0), CROUCH * body.scale)  # the lower, the more

    def lacking(shares: Array) -> Array:
        shoulders = place_shoulders(body, hip, shares * LEAN, shares * shares * low)[:, wanted]
        found: Array = (length(points - shoulders)[..., 0] - most).max(axis=-1)
        return found

    share = _least(lacking)
    return Stoop(share * LEAN, share * share * low), max(float(lacking(np.array([share]))[0]), 0.0)


def _least(lacking: Callable[[Array], Array]) -> float:
    """The least share from 0 to 1 with which nothing is lacking, or that with which least is."""
    low, high = 0.0, 1.0
    for _ in range(10):  # each time 40 times as fine
        shares = np.linspace(low, high, 41)
        values = lacking(shares)
        good = np.flatnonzero(values <= 0.0)
        if len(good) == 0:
            return float(shares[np.argmin(values)])
        if good[0] == 0:
            return float(shares[0])
        low, high = float(shares[good[0] - 1]), float(shares[good[0]])
    return high
