"""Limbs without joints: two links that reach, a trunk that bends, a foot that rolls, axes as rotations.

All of it works on arrays: `...` are leading axes, such as times and sides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.anatomy import HEEL_OFF, Body

Array = NDArray[np.float64]


def length(vectors: Array) -> Array:
    """Euclidean lengths (..., 1) of vectors (..., k)."""
    found: Array = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    return found


def two_link(roots: Array, targets: Array, upper: Array, lower: Array, bends: Array) -> tuple[Array, Array]:
    """Middle joints and ends of k two-link limbs that reach for targets.

    Args:
        roots: Shoulders or hips, (..., k, 3) [m].
        targets: Wanted wrists or ankles, (..., k, 3) [m].
        upper: Lengths of the first links, (k,) [m].
        lower: Lengths of the second links, (k,) [m].
        bends: Directions in which the middle joints leave the straight lines, (..., k, 3), not parallel to them.

    Returns:
        Middle joints and ends, (..., k, 3) each. An end is the target where that is within reach, else the nearest
        point that is: links never stretch.
    """
    upper, lower = upper[:, None], lower[:, None]
    lines = targets - roots
    asked = length(lines)
    distances = np.minimum(np.maximum(asked, np.abs(upper - lower) + 1e-9), upper + lower)
    along = lines / np.maximum(asked, 1e-12)
    across = bends - (bends * along).sum(axis=-1, keepdims=True) * along
    across = across / length(across)
    # law of cosines: the middle joint's projection on the line, and its height over it
    feet = (distances**2 + upper**2 - lower**2) / (2.0 * distances)
    heights = np.sqrt(np.maximum(upper**2 - feet**2, 0.0))
    return roots + feet * along + heights * across, roots + distances * along


def axis_quaternions(directions: Array) -> Array:
    """Shortest rotations that turn z into the given unit directions: (k, 3) -> (k, 4)."""
    quaternions = np.stack(
        [1.0 + directions[:, 2], -directions[:, 1], directions[:, 0], np.zeros(len(directions))], axis=1
    )
    quaternions[directions[:, 2] < -1.0 + 1e-9] = (0.0, 1.0, 0.0, 0.0)
    return quaternions / length(quaternions)


def bend_trunk(ends: Array, lean: Array, gaze: Array) -> None:
    """Bend the trunk forwards about the hips, and tilt the head; heights above the hips.

    Args:
        ends: Of the segments (T, segments, 2, 3) [m], changed in place.
        lean: Forwards (T,) [rad].
        gaze: By how much the head tilts forwards and to the left (T, 2) [rad].
    """
    # the head about the upper end of the neck, towards where it looks: Rodrigues about the level axis across it
    tilt = np.hypot(gaze[:, 0], gaze[:, 1])[:, None]
    c, s, towards = np.cos(tilt), np.sin(tilt), gaze[:, None] / np.maximum(tilt, 1e-300)[:, None]
    head = ends[:, 2] - ends[:, 1, 1:2]
    level, height = (head[..., :2] * towards).sum(axis=-1), head[..., 2]
    ends[:, 2, :, :2] += (level * (c - 1.0) + height * s)[..., None] * towards
    ends[:, 2, :, 2] += height * (c - 1.0) - level * s
    c, s = np.cos(lean)[:, None, None], np.sin(lean)[:, None, None]
    parts = [0, 1, 2, 4]  # all but the pelvis
    x, z = ends[:, parts][..., 0], ends[:, parts][..., 2]
    ends[..., 0][:, parts], ends[..., 2][:, parts] = c * x + s * z, c * z - s * x


def roll_foot(body: Body, ahead: Array, aside: Array, yaw: Array, lift: Array) -> tuple[Array, Array, Array]:
    """Ankle, heel and toe in the root's frame (..., 3); a foot that trails rolls up over its toes, which stay.

    Args:
        body: Whose foot it is.
        ahead: Of the foot in the root's frame, forwards (...) [m].
        aside: To the left (...) [m].
        yaw: Direction of the toes (...) [rad].
        lift: Height of the sole (...) [m].
    """
    c, s = np.cos(yaw), np.sin(yaw)
    share = np.clip((-(ahead * c + aside * s) - 0.06) / 0.26, 0.0, 1.0)
    roll = HEEL_OFF * share**2 * (3.0 - 2.0 * share)
    toe = np.stack((ahead + body.toe * c, aside + body.toe * s, lift + body.foot_radius), axis=-1)
    back, rise = np.cos(roll), np.sin(roll)  # along the sole from the toes

    def on_sole(behind: float, height: float) -> Array:
        """A point `behind` the toes and `height` over the sole's axis."""
        level = height * rise - behind * back
        return toe + np.stack((level * c, level * s, behind * rise + height * back), axis=-1)

    return on_sole(body.toe, body.ankle - body.foot_radius), on_sole(body.heel + body.toe, 0.0), toe
