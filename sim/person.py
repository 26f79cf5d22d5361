"""A person of 17 capsules who carries a card board upright in front of the chest.

The person is a stick figure with constant bone lengths: hips and shoulders follow the root, ankles and wrists are given
(by the footsteps and by the board), and two-link inverse kinematics places knees and elbows. A capsule is symmetric
about its axis, so the two end points of a bone say everything: no joints, no dynamics, nothing to integrate.

Frames: the root lies on the floor below the pelvis, x forward, y left, z up. World frame = robot base frame, in which
the floor has the height `floor` (negative).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.anatomy import (
    ANKLE,
    FOOT_RADIUS,
    FOREARM,
    HAND,
    HEEL,
    HEEL_OFF,
    HIP,
    LEG_USED,
    SEGMENTS,
    SHANK,
    SHOULDER,
    SHOULDER_HEIGHT,
    THIGH,
    TOE,
    TRUNK,
    UPPER_ARM,
    Segment,
)

__all__ = ["SEGMENTS", "Board", "Foot", "Person", "PersonPose", "Segment", "two_link"]

Array = NDArray[np.float64]


class Foot(NamedTuple):
    """Where a foot is, in the plane of the floor.

    Attributes:
        x, y: Of the ankle, world frame [m].
        yaw: Direction of the toes [rad].
        lift: Height of the sole above the floor [m].
    """

    x: float
    y: float
    yaw: float
    lift: float = 0.0


class Board(NamedTuple):
    """A card board and how it is held; its face is the side away from the person.

    Attributes:
        width, height, thickness: [m].
        reach: Horizontal distance from the person's root to the face [m].
        centre_height: Of its middle above the floor [m].
    """

    width: float = 0.60
    height: float = 0.70
    thickness: float = 0.006
    reach: float = 0.42
    centre_height: float = 1.20


@dataclass(frozen=True)
class PersonPose:
    """Where every part of the person and the board is, world frame.

    Attributes:
        ends: The two end points of every capsule's axis, in the order of `SEGMENTS`, (17, 2, 3) [m].
        positions: Centres of the capsules, (17, 3) [m].
        quaternions: w, x, y, z; turns z into the capsules' axes, (17, 4).
        board_position: Centre of the board, (3,) [m].
        board_quaternion: w, x, y, z; board frame: x out of its face, y to its left, z up, (4,).
        board_face: Centre of the face away from the person, (3,) [m].
        heading: Direction the person looks and the board faces [rad].
    """

    ends: Array
    positions: Array
    quaternions: Array
    board_position: Array
    board_quaternion: Array
    board_face: Array
    heading: float


def two_link(roots: Array, targets: Array, upper: Array, lower: Array, bends: Array) -> tuple[Array, Array]:
    """Middle joints and ends of k two-link limbs that reach for targets.

    Args:
        roots: Shoulders or hips, (k, 3) [m].
        targets: Wanted wrists or ankles, (k, 3) [m].
        upper: Lengths of the first links, (k,) [m].
        lower: Lengths of the second links, (k,) [m].
        bends: Directions in which the middle joints leave the straight lines, (k, 3), not parallel to them.

    Returns:
        Middle joints and ends, (k, 3) each. An end is the target where that is within reach, else the nearest point
        that is: links never stretch.
    """
    lines = targets - roots
    asked = np.sqrt((lines * lines).sum(axis=1))
    distances = np.minimum(np.maximum(asked, np.abs(upper - lower) + 1e-9), upper + lower)
    along = lines / np.maximum(asked, 1e-12)[:, None]
    across = bends - (bends * along).sum(axis=1)[:, None] * along
    across = across / np.sqrt((across * across).sum(axis=1))[:, None]
    # law of cosines: the middle joint's projection on the line, and its height over it
    feet = (distances**2 + upper**2 - lower**2) / (2.0 * distances)
    heights = np.sqrt(np.maximum(upper**2 - feet**2, 0.0))
    return roots + feet[:, None] * along + heights[:, None] * across, roots + distances[:, None] * along


def _axis_quaternions(directions: Array) -> Array:
    """Shortest rotations that turn z into the given unit directions: (k, 3) -> (k, 4)."""
    quaternions = np.stack(
        [1.0 + directions[:, 2], -directions[:, 1], directions[:, 0], np.zeros(len(directions))], axis=1
    )
    quaternions[directions[:, 2] < -1.0 + 1e-9] = (0.0, 1.0, 0.0, 0.0)
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


@dataclass(frozen=True)
class Person:
    """The kinematics of the person: root and feet in, capsules and board out.

    Attributes:
        floor: Height of the floor in the world frame [m].
        board: The card board.
    """

    floor: float = -0.55
    board: Board = field(default_factory=Board)

    def standing_feet(self, x: float, y: float, heading: float) -> tuple[Foot, Foot]:
        """Left and right foot of a person who stands still at (x, y) [m], looking along `heading` [rad]."""
        dx, dy = -math.sin(heading) * (HIP + 0.005), math.cos(heading) * (HIP + 0.005)
        return Foot(x + dx, y + dy, heading + 0.10), Foot(x - dx, y - dy, heading - 0.10)

    def pose(self, x: float, y: float, heading: float, feet: tuple[Foot, Foot] | None = None) -> PersonPose:
        """Place the person.

        Args:
            x, y: Root, world frame [m].
            heading: Direction the person looks [rad].
            feet: Left and right foot; default standing still.

        Returns:
            The poses of all capsules and of the board.
        """
        feet = feet or self.standing_feet(x, y, heading)
        cos, sin = math.cos(heading), math.sin(heading)
        # The farther a foot stands from below its hip, the lower the hips: the bob of an inverted pendulum. The lower
        # of the two legs' wishes counts, rounded off where they cross.
        leg, wishes = LEG_USED * (THIGH + SHANK), []
        for side, foot in zip((HIP, -HIP), feet, strict=True):
            away = math.hypot(foot.x - x + side * sin, foot.y - y - side * cos)
            wishes.append(math.sqrt(leg**2 - min(away, 0.5) ** 2))
        a, b = wishes
        hip = ANKLE + 0.5 * (a + b - math.hypot(a - b, 0.01))

        # Everything in the root's frame first: x forward, y left, z up from the floor.
        ends = np.empty((len(SEGMENTS), 2, 3))
        ends[:5] = TRUNK
        ends[:5, :, 2] += hip

        board = self.board
        roots, targets, bends = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
        for i, (side, foot) in enumerate(zip((1.0, -1.0), feet, strict=True)):
            dx, dy, yaw = foot.x - x, foot.y - y, foot.yaw - heading
            ankle, heel, toe = _roll(cos * dx + sin * dy, cos * dy - sin * dx, yaw, foot.lift)
            roots[i], targets[i] = (0.0, side * HIP, hip), ankle
            bends[i] = 1.0 + 0.5 * math.cos(yaw), 0.5 * math.sin(yaw), 0.0  # knees point forwards and along the toes
            ends[5 + 6 * i + 2] = heel, toe
            # fingers at the board's edge, a little below its middle
            edge_x, edge_y = board.reach - board.thickness / 2, side * (board.width / 2 + 0.012)
            wrist = (edge_x - 0.055, edge_y, board.centre_height - 0.07)
            roots[2 + i], targets[2 + i] = (0.0, side * SHOULDER, hip + SHOULDER_HEIGHT), wrist
            bends[2 + i] = -0.2, 0.55 * side, -1.0
            ends[5 + 6 * i + 5, 1] = wrist[0] + _FINGERS[0], wrist[1], wrist[2] + _FINGERS[1]
        middles, tips = two_link(roots, targets, _UPPER, _LOWER, bends)
        for i in (0, 1):
            row = 5 + 6 * i
            ends[row, 0], ends[row, 1] = middles[i], roots[i]  # thigh
            ends[row + 1, 0], ends[row + 1, 1] = tips[i], middles[i]  # shank
            ends[row + 3, 0], ends[row + 3, 1] = middles[2 + i], roots[2 + i]  # upper arm
            ends[row + 4, 0], ends[row + 4, 1] = tips[2 + i], middles[2 + i]  # forearm
            ends[row + 5, 0] = tips[2 + i]  # hand

        rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        origin = np.array([x, y, self.floor])
        ends = ends @ rotation.T + origin
        axes = ends[:, 1] - ends[:, 0]
        face = rotation @ (board.reach, 0.0, board.centre_height) + origin
        return PersonPose(
            ends=ends,
            positions=0.5 * (ends[:, 0] + ends[:, 1]),
            quaternions=_axis_quaternions(axes / np.sqrt((axes * axes).sum(axis=1))[:, None]),
            board_position=face - board.thickness / 2 * rotation[:, 0],
            board_quaternion=np.array([math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)]),
            board_face=face,
            heading=heading,
        )


_UPPER = np.array([THIGH, THIGH, UPPER_ARM, UPPER_ARM])
_LOWER = np.array([SHANK, SHANK, FOREARM, FOREARM])
_FINGERS = HAND * math.cos(0.18), HAND * math.sin(0.18)  # from the wrist forwards and a little up
_Point = tuple[float, float, float]


def _roll(x: float, y: float, yaw: float, lift: float) -> tuple[_Point, _Point, _Point]:
    """Ankle, heel and toe in the root's frame; a foot that trails rolls up over its toes, which stay where they are."""
    c, s = math.cos(yaw), math.sin(yaw)
    share = min(max((-(x * c + y * s) - 0.06) / 0.26, 0.0), 1.0)
    roll = HEEL_OFF * share**2 * (3.0 - 2.0 * share)
    toe = (x + TOE * c, y + TOE * s, lift + FOOT_RADIUS)
    back, rise = math.cos(roll), math.sin(roll)  # along the sole from the toes

    def on_sole(length: float, height: float) -> _Point:
        """A point `length` behind the toes and `height` over the sole's axis."""
        horizontal = height * rise - length * back
        return toe[0] + horizontal * c, toe[1] + horizontal * s, toe[2] + length * rise + height * back

    return on_sole(TOE, ANKLE - FOOT_RADIUS), on_sole(HEEL + TOE, 0.0), toe
