"""Limbs without joints: two links that reach, a trunk that bends, a foot that rolls, axes as rotations."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import HEEL_OFF, Body

Array = NDArray[np.float64]
Place = tuple[float, float, float]


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


def axis_quaternions(directions: Array) -> Array:
    """Shortest rotations that turn z into the given unit directions: (k, 3) -> (k, 4)."""
    quaternions = np.stack(
        [1.0 + directions[:, 2], -directions[:, 1], directions[:, 0], np.zeros(len(directions))], axis=1
    )
    quaternions[directions[:, 2] < -1.0 + 1e-9] = (0.0, 1.0, 0.0, 0.0)
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def bend_trunk(ends: Array, lean: float, gaze: tuple[float, float]) -> None:
    """Bend the trunk forwards about the hips, and tilt the head; heights above the hips.

    Args:
        ends: Of the segments (segments, 2, 3) [m], changed in place.
        lean: Forwards [rad].
        gaze: By how much the head tilts forwards and to the left [rad].
    """
    neck = ends[1, 1].copy()
    tilt = math.hypot(*gaze)
    if tilt > 0.0:  # the head about the upper end of the neck, towards where it looks
        c, s, towards = math.cos(tilt), math.sin(tilt), np.array([gaze[0] / tilt, gaze[1] / tilt, 0.0])
        for k in (0, 1):
            part = ends[2, k] - neck
            level = float(part @ towards)
            ends[2, k] += (level * (c - 1.0) + part[2] * s) * towards
            ends[2, k, 2] += part[2] * (c - 1.0) - level * s
    if lean > 0.0:
        c, s = math.cos(lean), math.sin(lean)
        for k in (0, 1, 2, 4):
            x, z = ends[k, :, 0].copy(), ends[k, :, 2].copy()
            ends[k, :, 0], ends[k, :, 2] = c * x + s * z, c * z - s * x


def roll_foot(body: Body, x: float, y: float, yaw: float, lift: float) -> tuple[Place, Place, Place]:
    """Ankle, heel and toe in the root's frame; a foot that trails rolls up over its toes, which stay where they are.

    Args:
        body: Whose foot it is.
        x: Of the foot in the root's frame, forwards [m].
        y: To the left [m].
        yaw: [rad].
        lift: Height of the sole [m].
    """
    c, s = math.cos(yaw), math.sin(yaw)
    share = min(max((-(x * c + y * s) - 0.06) / 0.26, 0.0), 1.0)
    roll = HEEL_OFF * share**2 * (3.0 - 2.0 * share)
    toe = (x + body.toe * c, y + body.toe * s, lift + body.foot_radius)
    back, rise = math.cos(roll), math.sin(roll)  # along the sole from the toes

    def on_sole(length: float, height: float) -> Place:
        """A point `length` behind the toes and `height` over the sole's axis."""
        horizontal = height * rise - length * back
        return toe[0] + horizontal * c, toe[1] + horizontal * s, toe[2] + length * rise + height * back

    return on_sole(body.toe, body.ankle - body.foot_radius), on_sole(body.heel + body.toe, 0.0), toe
