"""Capsules along a robot's links against points: how far away, and how fast nearer with the joints' velocities.

With a the nearest point of a capsule's axis to the point p, and r its radius, the distance is |p - a| - r. The nearest
point of the surface is a + r n, n = (p - a)/|p - a|, and approaches p as fast as a does, since a turn about a moves it
at right angles to n: the speed of approach is nᵀ J(a) q̇. J is linear between the ends of an axis, as in eq. (4).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.fixed import Fixed

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class LinkParts(Fixed):
    """Capsules that move with a robot's bodies; its arrays are read-only.

    Args:
        names: (c,).
        bodies: That carry the ends of their axes (c, 2), numbered as in `RobotState.body_poses`.
        ends: Places of the ends in those bodies' frames (c, 2, 3) [m].
        radii: (c,) [m].
    """

    fixed = frozenset(("names", "bodies", "ends", "radii"))

    def __init__(self, names: tuple[str, ...], bodies: ArrayLike, ends: ArrayLike, radii: ArrayLike) -> None:
        self.names = names
        self.bodies: Index = np.array(bodies, dtype=np.int64).reshape(-1, 2)
        self.ends, self.radii = np.array(ends, dtype=float).reshape(-1, 2, 3), np.array(radii, dtype=float)
        for table in (self.bodies, self.ends, self.radii):
            table.flags.writeable = False

    @classmethod
    def wire(cls, robot: Robot) -> LinkParts:
        """The links of a robot's wire, without thickness: for robots whose model has no collision geometry."""
        mountings = [(robot.mounting(start), robot.mounting(end)) for start, end in robot.wire_frames]
        return cls(
            tuple(f"{start} to {end}" for start, end in robot.wire_frames),
            [[body for body, _ in pair] for pair in mountings],
            [[place[:3, 3] for _, place in pair] for pair in mountings],
            np.zeros(len(mountings)),
        )

    def approaches(self, state: RobotState, points: Array) -> tuple[Array, Array]:
        """Every part against every point: distances (c p,) [m] and rows (c p, n) that times q̇ are speeds of approach.

        A point on an axis has no direction from it: any one across the axis is taken.

        Args:
            state: The robot.
            points: World frame (p, 3) [m].
        """
        places, jacobians = self.motion(state)
        first, along = places[:, 0], places[:, 1] - places[:, 0]
        off = points - first[:, None]  # (c, p, 3)
        square = (along * along).sum(axis=1)
        t = np.clip(np.einsum("cpk,ck->cp", off, along) / np.where(square > 0.0, square, 1.0)[:, None], 0.0, 1.0)
        away = off - t[..., None] * along[:, None]
        length = np.sqrt((away * away).sum(axis=-1))
        on_axis = length < ON_AXIS
        if on_axis.any():
            away[on_axis] = np.broadcast_to(_across(along)[:, None], away.shape)[on_axis]
        n = away / np.where(on_axis, 1.0, length)[..., None]
        rows = (1.0 - t)[..., None] * np.einsum("cpk,ckj->cpj", n, jacobians[:, 0])
        rows += t[..., None] * np.einsum("cpk,ckj->cpj", n, jacobians[:, 1])
        return (length - self.radii[:, None]).ravel(), rows.reshape(-1, rows.shape[-1])

    def motion(self, state: RobotState) -> tuple[Array, Array]:
        """The ends of all axes in the world (c, 2, 3) [m], and their linear Jacobians (c, 2, 3, n)."""
        poses, tree = state.body_poses(), state.robot.tree
        carriers = poses[self.bodies]
        places = (carriers[..., :3, :3] @ self.ends[..., None])[..., 0] + carriers[..., :3, 3]
        turns, origins = poses[1:, :3, :3], poses[1:, :3, 3]
        v = (turns @ tree.axes[:, :3, None])[..., 0]
        w = (turns @ tree.axes[:, 3:, None])[..., 0]
        moved = v + np.cross(w, places[:, :, None] - origins)  # of each end with each joint (c, 2, n, 3)
        moved *= tree.supports[self.bodies][..., None]
        return places, np.ascontiguousarray(np.swapaxes(moved, 2, 3))


ON_AXIS = 1e-9  # a point nearer than that to an axis has no direction from it [m]


def _across(along: Array) -> Array:
    """Unit vectors at right angles to some vectors (c, 3)."""
    other = np.eye(3)[np.abs(along).argmin(axis=1)]
    across = np.cross(along, other)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    return np.where(size > 0.0, across / np.where(size > 0.0, size, 1.0), other)
