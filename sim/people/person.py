"""A person of 17 capsules who may carry a card board upright in front of the chest.

The person is a stick figure with constant bone lengths: hips and shoulders follow the root, ankles and wrists are given
(by the footsteps, by the board or by what the hands reach for), and two-link inverse kinematics places knees and
elbows. A capsule is symmetric about its axis, so the two end points of a bone say everything: no joints, no dynamics,
nothing to integrate.

Frames: the root lies on the floor below the pelvis, x forward, y left, z up. World frame = robot base frame, in which
the floor has the height `floor` (negative).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import FIRST, LEG_USED, SEGMENTS, Body, Segment
from qpsafe.sim.people.limbs import bend_trunk, roll_foot, two_link
from qpsafe.sim.people.poses import PersonPose, PersonPoses
from qpsafe.sim.people.posture import (
    FINGERS,
    Point,
    Posture,
    Postures,
    Stoop,
    least_stoop,
    place_hands,
    place_shoulders,
)

__all__ = ["SEGMENTS", "Board", "Foot", "Person", "PersonPose", "PersonPoses", "Segment"]

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
        left, right = self.standing(np.array([[x, y, heading]]))[0].tolist()
        return Foot(*left), Foot(*right)

    def standing(self, roots: Array) -> Array:
        """Rows of `Foot`, left and right, of a person who stands still: roots (T, 3) -> (T, 2, 4)."""
        x, y, heading = roots.T
        dx, dy = -np.sin(heading) * (self.body.hip + 0.005), np.cos(heading) * (self.body.hip + 0.005)
        feet = np.zeros((len(roots), 2, 4))
        feet[:, 0, :3] = np.stack((x + dx, y + dy, heading + 0.10), axis=-1)
        feet[:, 1, :3] = np.stack((x - dx, y - dy, heading - 0.10), axis=-1)
        return feet

    def pose(
        self,
        x: float,
        y: float,
        heading: float,
        feet: tuple[Foot, Foot] | None = None,
        posture: Posture | None = None,
    ) -> PersonPose:
        """Place the person: `poses` at one time.

        Args:
            x, y: Root, world frame [m].
            heading: Direction the person looks [rad].
            feet: Left and right foot; default standing still.
            posture: What arms, back and head do; by default the board is held, or the arms hang.

        Returns:
            The poses of all capsules and of the board.
        """
        places = None if feet is None else np.array([feet], dtype=float)
        postures = None if posture is None else Postures.of(posture)
        return self.poses(np.array([[x, y, heading]], dtype=float), places, postures)[0]

    def poses(self, roots: Array, feet: Array | None = None, postures: Postures | None = None) -> PersonPoses:
        """Place the person at T times at once.

        Args:
            roots: x, y [m] and heading [rad], world frame (T, 3).
            feet: Rows of `Foot`, left and right (T, 2, 4); default standing still.
            postures: What arms, back and head do; by default the board is held, or the arms hang.
        """
        body, board, count = self.body, self.board, len(roots)
        feet = self.standing(roots) if feet is None else feet
        x, y, heading = roots.T
        cos, sin = np.cos(heading), np.sin(heading)
        # Everything in the root's frame first: x forward, y left, z up from the floor.
        dx, dy = feet[..., 0] - x[:, None], feet[..., 1] - y[:, None]
        ahead, aside = cos[:, None] * dx + sin[:, None] * dy, cos[:, None] * dy - sin[:, None] * dx
        yaw = feet[..., 2] - heading[:, None]
        ankles, heels, toes = roll_foot(body, ahead, aside, yaw, feet[..., 3])
        free = postures is not None or board is None
        postures = postures or Postures.of(Posture())
        hold = self._nominal if postures.hold is None else postures.hold
        edges = self._edges(hold)
        if free:
            hip = self._hip_of_free(ankles)
            shoulders, wrists, fingers = place_hands(body, hip, postures, ahead[:, ::-1], edges)
            hip = hip - postures.stoop[:, 1]
        else:
            hip = self._hip(ahead, aside)
            shoulders = np.zeros((count, 2, 3))
            shoulders[..., 1], shoulders[..., 2] = (body.shoulder, -body.shoulder), hip[:, None] + body.trunk
            wrists = np.broadcast_to(edges, shoulders.shape)
            fingers = wrists + body.hand * FINGERS

        ends = np.empty((count, len(SEGMENTS), 2, 3))
        ends[:, :5] = body.frame
        if free:
            bend_trunk(ends, postures.stoop[:, 0], postures.gaze)
        ends[:, :5, :, 2] += hip[:, None, None]
        # limbs in the order left leg, right leg, left arm, right arm
        hips, bends = np.zeros((count, 2, 3)), np.empty((count, 4, 3))
        hips[..., 1], hips[..., 2] = (body.hip, -body.hip), hip[:, None]
        # knees point forwards and along the toes; elbows at the board down and outwards, those of free arms also back,
        # which is where hanging arms bend
        bends[:, :2] = np.stack((1.0 + 0.5 * np.cos(yaw), 0.5 * np.sin(yaw), np.zeros_like(yaw)), axis=-1)
        bends[:, 2:] = [(-0.8, 0.35 * side, -1.0) if free else (-0.2, 0.55 * side, -1.0) for side in (1.0, -1.0)]
        starts = np.concatenate((hips, shoulders), axis=1)
        upper = np.array([body.thigh, body.thigh, body.upper_arm, body.upper_arm])
        lower = np.array([body.shank, body.shank, body.forearm, body.forearm])
        middles, tips = two_link(starts, np.concatenate((ankles, wrists), axis=1), upper, lower, bends)
        for limb, row in enumerate((5, 11, 8, 14)):
            ends[:, row, 0], ends[:, row, 1] = middles[:, limb], starts[:, limb]  # thigh, upper arm
            ends[:, row + 1, 0], ends[:, row + 1, 1] = tips[:, limb], middles[:, limb]  # shank, forearm
        ends[:, [7, 13], 0], ends[:, [7, 13], 1] = heels, toes
        ends[:, [10, 16], 0], ends[:, [10, 16], 1] = tips[:, 2:], fingers

        # ... then into the world
        level = ends[..., :2].copy()
        c, s = cos[:, None, None], sin[:, None, None]
        ends[..., 0] = c * level[..., 0] - s * level[..., 1] + x[:, None, None]
        ends[..., 1] = s * level[..., 0] + c * level[..., 1] + y[:, None, None]
        ends[..., 2] += self.floor
        if board is None:
            return PersonPoses(ends, heading)
        reach, facing = hold[:, 0], heading
        faces = np.stack((cos * reach + x, sin * reach + y, np.broadcast_to(hold[:, 1] + self.floor, x.shape)), axis=-1)
        if postures.resting is not None:
            there = np.isfinite(postures.resting[:, 0])
            facing = np.where(there, postures.resting[:, 2], heading)
            stood = postures.resting[:, [0, 1, 3]] + (0.0, 0.0, self.floor)
            faces = np.where(there[:, None], stood, faces)
        return PersonPoses(ends, heading, faces, facing, board.thickness)

    def least_stoop(self, goals: Sequence[Point | str], hold: tuple[float, float] | None = None) -> tuple[Stoop, float]:
        """The least stoop for goals of both arms when standing, and by how much they are too short even so [m]."""
        at = self._nominal if hold is None else np.array([hold])
        hip = self.body.ankle + LEG_USED * (self.body.thigh + self.body.shank)
        return least_stoop(self.body, hip, goals, self._edges(at)[0])

    def shoulders(self, stoop: Stoop) -> Array:
        """Left and right shoulder of somebody who stands and stoops so (2, 3), root's frame [m]."""
        hip = self.body.ankle + LEG_USED * (self.body.thigh + self.body.shank)
        return place_shoulders(self.body, hip, *np.array(stoop))

    @property
    def _nominal(self) -> Array:
        """How the board is held, (1, 2)."""
        return np.array([(0.0, 0.0) if self.board is None else (self.board.reach, self.board.centre_height)])

    def _edges(self, hold: Array) -> Array:
        """Wrists (T, 2, 3) that hold the board's edges a little below its middle; root's frame."""
        wrists, board = np.zeros((len(hold), 2, 3)), self.board
        if board is not None:
            # the fingertips a little past the board, whatever the length of the hand
            wrists[..., 0] = hold[:, :1] - board.thickness / 2 - max(self.body.hand - 0.02, 0.055)
            wrists[..., 1] = np.array([1.0, -1.0]) * (board.width / 2 + 0.012)
            wrists[..., 2] = hold[:, 1:] - 0.07
        return wrists

    def _hip(self, ahead: Array, aside: Array) -> Array:
        """Height of the hips (T,).

        The farther a foot stands from below its hip, the lower the hips: the bob of an inverted pendulum. The lower
        of the two legs' wishes counts, rounded off where they cross.
        """
        leg = LEG_USED * (self.body.thigh + self.body.shank)
        away = np.hypot(ahead, aside - np.array([self.body.hip, -self.body.hip]))
        wishes = np.sqrt(leg**2 - np.minimum(away, 0.5) ** 2)
        return self.body.ankle + _lower(wishes[:, 0], wishes[:, 1], 0.01)

    def _hip_of_free(self, ankles: Array) -> Array:
        """Height of the hips of somebody who walks at any speed (T,): as high as both legs allow, rounded off."""
        body, leg = self.body, LEG_USED * (self.body.thigh + self.body.shank)
        away = np.hypot(ankles[..., 0], ankles[..., 1] - np.array([body.hip, -body.hip]))
        heights = ankles[..., 2] + np.sqrt(leg**2 - np.minimum(away, 0.70 * leg) ** 2)
        # a trailing foot on its toes, or a lifted one, would allow more than standing does
        upright = body.ankle + leg
        return _lower(_lower(heights[:, 0], heights[:, 1], 0.03) + 0.012, upright + 0.01, 0.02)


def _lower(a: Array, b: Array | float, rounding: float) -> Array:
    """The lower of two heights, rounded off where they cross [m]."""
    found: Array = 0.5 * (a + b - np.hypot(a - b, rounding))
    return found
