"""A person of 17 capsules who may carry a card board upright in front of the chest.

The person is a stick figure with constant bone lengths: hips and shoulders follow the root, ankles and wrists are given
(by the footsteps, by the board or by what the hands reach for), and two-link inverse kinematics places knees and
elbows. A capsule is symmetric about its axis, so the two end points of a bone say everything: no joints, no dynamics,
nothing to integrate.

Frames: the root lies on the floor below the pelvis, x forward, y left, z up. World frame = robot base frame, in which
the floor has the height `floor` (negative).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import FIRST, LEG_USED, SEGMENTS, Body, Segment
from qpsafe.sim.people.limbs import Place, axis_quaternions, bend_trunk, roll_foot, two_link
from qpsafe.sim.people.posture import Point, Posture, Stoop, least_stoop, place_hands

__all__ = ["SEGMENTS", "Board", "Foot", "Person", "PersonPose", "Segment"]

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
        board_position: Centre of the board, (3,) [m]; None without one, like the next two.
        board_quaternion: w, x, y, z; board frame: x out of its face, y to its left, z up, (4,).
        board_face: Centre of the face away from the person, (3,) [m].
        heading: Direction the person looks [rad].
    """

    ends: Array
    positions: Array
    quaternions: Array
    board_position: Array | None
    board_quaternion: Array | None
    board_face: Array | None
    heading: float

    @property
    def hands(self) -> Array:
        """Grips of the left and the right hand: the far ends of their axes (2, 3) [m]."""
        return self.ends[[10, 16], 1]


@dataclass(frozen=True)
class Person:
    """The kinematics of the person: root and feet in, capsules and board out.

    Attributes:
        floor: Height of the floor in the world frame [m].
        board: The card board; None for a person without one.
        body: How tall, and of what lengths.
    """

    floor: float = -0.55
    board: Board | None = field(default_factory=Board)
    body: Body = FIRST

    def standing_feet(self, x: float, y: float, heading: float) -> tuple[Foot, Foot]:
        """Left and right foot of a person who stands still at (x, y) [m], looking along `heading` [rad].

        Args:
            x: [m].
            y: [m].
            heading: [rad].
        """
        dx, dy = -math.sin(heading) * (self.body.hip + 0.005), math.cos(heading) * (self.body.hip + 0.005)
        return Foot(x + dx, y + dy, heading + 0.10), Foot(x - dx, y - dy, heading - 0.10)

    def pose(
        self,
        x: float,
        y: float,
        heading: float,
        feet: tuple[Foot, Foot] | None = None,
        posture: Posture | None = None,
    ) -> PersonPose:
        """Place the person.

        Args:
            x, y: Root, world frame [m].
            heading: Direction the person looks [rad].
            feet: Left and right foot; default standing still.
            posture: What arms, back and head do; by default the board is held, or the arms hang.

        Returns:
            The poses of all capsules and of the board.
        """
        feet = feet or self.standing_feet(x, y, heading)
        body, cos, sin = self.body, math.cos(heading), math.sin(heading)
        soles = []  # ankle, heel and toe of each foot
        for foot in feet:
            dx, dy = foot.x - x, foot.y - y
            soles.append(roll_foot(body, cos * dx + sin * dy, cos * dy - sin * dx, foot.yaw - heading, foot.lift))
        board, lean, free = self.board, 0.0, posture is not None or self.board is None
        reach, centre = (0.0, 0.0) if board is None else (board.reach, board.centre_height)
        if not free:
            hip = self._hip(x, y, cos, sin, feet)
            wrists, fingers = self._edges(reach, centre)
            shoulders = np.array([[0.0, body.shoulder, hip + body.trunk], [0.0, -body.shoulder, hip + body.trunk]])
        else:
            posture = posture or Posture()
            hip, lean = self._hip_of_free(soles), posture.stoop.lean
            reach, centre = posture.hold or (reach, centre)
            ahead = [cos * (foot.x - x) + sin * (foot.y - y) for foot in feet]
            edges = np.vstack((self._edges(reach, centre)[0], _FINGERS))
            shoulders, wrists, fingers = place_hands(body, hip, posture.stoop, ahead[::-1], posture.arms, edges)
            hip -= posture.stoop.crouch

        # Everything in the root's frame first: x forward, y left, z up from the floor.
        ends = np.empty((len(SEGMENTS), 2, 3))
        ends[:5] = body.frame
        if posture is not None:
            bend_trunk(ends, lean, posture.gaze)
        ends[:5, :, 2] += hip

        roots, targets, bends = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
        for i, (side, foot) in enumerate(zip((1.0, -1.0), feet, strict=True)):
            yaw, (ankle, heel, toe) = foot.yaw - heading, soles[i]
            roots[i], targets[i] = (0.0, side * body.hip, hip), ankle
            bends[i] = 1.0 + 0.5 * math.cos(yaw), 0.5 * math.sin(yaw), 0.0  # knees point forwards and along the toes
            ends[5 + 6 * i + 2] = heel, toe
            roots[2 + i], targets[2 + i] = shoulders[i], wrists[i]
            # elbows down and outwards at the board; those of free arms also back, which is where hanging arms bend
            bends[2 + i] = (-0.8, 0.35 * side, -1.0) if free else (-0.2, 0.55 * side, -1.0)
            ends[5 + 6 * i + 5, 1] = fingers[i]
        upper = np.array([body.thigh, body.thigh, body.upper_arm, body.upper_arm])
        lower = np.array([body.shank, body.shank, body.forearm, body.forearm])
        middles, tips = two_link(roots, targets, upper, lower, bends)
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
        face, thickness, facing = None, 0.0, heading
        if board is not None:
            thickness = board.thickness
            if posture is not None and posture.resting is not None:
                *place, facing, centre = posture.resting
                face = np.array([*place, centre + self.floor])
            else:
                face = rotation @ (reach, 0.0, centre) + origin
        out = np.array([math.cos(facing), math.sin(facing), 0.0])
        return PersonPose(
            ends=ends,
            positions=0.5 * (ends[:, 0] + ends[:, 1]),
            quaternions=axis_quaternions(axes / np.sqrt((axes * axes).sum(axis=1))[:, None]),
            board_position=None if face is None else face - thickness / 2 * out,
            board_quaternion=None if face is None else np.array([math.cos(facing / 2), 0, 0, math.sin(facing / 2)]),
            board_face=face,
            heading=heading,
        )

    def least_stoop(self, goals: Sequence[Point | str], hold: tuple[float, float] | None = None) -> tuple[Stoop, float]:
        """The least stoop for goals of both arms when standing, and by how much they are too short even so [m]."""
        body, board = self.body, self.board
        hold = hold or ((0.0, 0.0) if board is None else (board.reach, board.centre_height))
        hip = body.ankle + LEG_USED * (body.thigh + body.shank)
        return least_stoop(body, hip, goals, np.vstack((self._edges(*hold)[0], _FINGERS)))

    def _edges(self, reach: float, centre: float) -> tuple[Array, Array]:
        """Wrists and fingers (2, 3) that hold the board's edges a little below its middle; root's frame."""
        wrists, fingers, board = np.zeros((2, 3)), np.zeros((2, 3)), self.board
        for i, side in enumerate((1.0, -1.0) if board is not None else ()):
            edge_x, edge_y = reach - board.thickness / 2, side * (board.width / 2 + 0.012)  # type: ignore[union-attr]
            # the fingertips a little past the board, whatever the length of the hand
            wrists[i] = edge_x - max(self.body.hand - 0.02, 0.055), edge_y, centre - 0.07
            fingers[i] = wrists[i] + self.body.hand * np.array(_FINGERS)
        return wrists, fingers

    def _hip(self, x: float, y: float, cos: float, sin: float, feet: tuple[Foot, Foot]) -> float:
        """Height of the hips.

        The farther a foot stands from below its hip, the lower the hips: the bob of an inverted pendulum. The lower
        of the two legs' wishes counts, rounded off where they cross.
        """
        half = self.body.hip
        leg, wishes = LEG_USED * (self.body.thigh + self.body.shank), []
        for side, foot in zip((half, -half), feet, strict=True):
            away = math.hypot(foot.x - x + side * sin, foot.y - y - side * cos)
            wishes.append(math.sqrt(leg**2 - min(away, 0.5) ** 2))
        a, b = wishes
        return self.body.ankle + 0.5 * (a + b - math.hypot(a - b, 0.01))

    def _hip_of_free(self, soles: Sequence[tuple[Place, Place, Place]]) -> float:
        """Height of the hips of somebody who walks at any speed: as high as both legs allow, rounded off."""
        body, leg = self.body, LEG_USED * (self.body.thigh + self.body.shank)
        heights = []
        for side, ((x, y, z), _, _) in zip((body.hip, -body.hip), soles, strict=True):
            heights.append(z + math.sqrt(leg**2 - min(math.hypot(x, y - side), 0.70 * leg) ** 2))
        # a trailing foot on its toes, or a lifted one, would allow more than standing does
        upright = body.ankle + leg
        left, right = heights
        return _lower(_lower(left, right, 0.03) + 0.012, upright + 0.01, 0.02)


def _lower(a: float, b: float, rounding: float) -> float:
    """The lower of two heights, rounded off where they cross [m]."""
    return 0.5 * (a + b - math.hypot(a - b, rounding))


_FINGERS = math.cos(0.18), 0.0, math.sin(0.18)  # at the board, from the wrist forwards and a little up
