"""Capsules along a robot's links against points: how far away, and how fast nearer with the joints' velocities.

With a the nearest point of a capsule's axis to the point p, and r its radius, the distance is |p - a| - r. The nearest
point of the surface is a + r n, n = (p - a)/|p - a|, and approaches p as fast as a does, since a turn about a moves it
at right angles to n: the speed of approach is nᵀ J(a) q̇. J is linear between the ends of an axis, as in eq. (4).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.fixed import Fixed

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Gaps(NamedTuple):
    """Some pairs of a part and a point, by part and then by point.

    Attributes:
        which: Their numbers: that of the part times the number of points, plus that of the point (r,).
        distances: (r,) [m].
        rows: nᵀ J(a), which times q̇ is the speed of approach (r, n).
    """

    which: Index
    distances: Array
    rows: Array


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

    def gaps(self, state: RobotState, points: Array, most: Callable[[Array], Array] | None = None) -> Gaps:
        """Pairs of a part and a point; a point on an axis has no direction from it: any one across the axis is taken.

        Args:
            state: The robot.
            points: World frame (p, 3) [m].
            most: Tells the distances from which on pairs are left out (c,) [m], from how fast each joint moves any
                point of each part at most (c, n) [m/rad, 1]. All pairs count without it.
        """
        from qpsafe.danger.gaps_kernel import near_pairs  # compiled where it is used

        places, jacobians = self.motion(state)
        c, n = len(self.radii), jacobians.shape[-1]
        far = np.full(c, np.inf) if most is None else most(np.sqrt((jacobians * jacobians).sum(axis=2)).max(axis=1))
        room = c * len(points)
        which, distances, rows = np.empty(room, dtype=np.int64), np.empty(room), np.empty((room, n))
        count = near_pairs(places, jacobians, self.radii, points, far, which, distances, rows)
        return Gaps(which[:count], distances[:count], rows[:count])

    def approaches(self, state: RobotState, points: Array) -> tuple[Array, Array]:
        """Distances (c p,) [m] and rows (c p, n) that times q̇ are speeds of approach, of every part and point.

        Args:
            state: The robot.
            points: World frame (p, 3) [m].
        """
        gaps = self.gaps(state, points)
        return gaps.distances, gaps.rows

    def motion(self, state: RobotState) -> tuple[Array, Array]:
        """The ends of all axes in the world (c, 2, 3) [m], and their linear Jacobians (c, 2, 3, n)."""
        poses, tree = state.body_poses(), state.robot.tree
        carriers = poses[self.bodies]
        places = (carriers[..., :3, :3] @ self.ends[..., None])[..., 0] + carriers[..., :3, 3]
        turns, origins = poses[1:, :3, :3], poses[1:, :3, 3]
        v = (turns @ tree.axes[:, :3, None])[..., 0]
        w = (turns @ tree.axes[:, 3:, None])[..., 0]
        arm, on = places[:, :, None] - origins, tree.supports[self.bodies]  # (c, 2, n, 3), (c, 2, n)
        moved = np.empty((*places.shape, len(v)))  # v + w × arm, of each end with each joint
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            moved[:, :, i] = on * (v[:, i] + w[:, j] * arm[..., k] - w[:, k] * arm[..., j])
        return places, moved
