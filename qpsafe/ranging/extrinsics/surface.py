"""The robot's surface as samples with normals, at any configuration: what a camera may see of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sensing.body import body_hull_set, body_hulls

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: A sample this deep in another hull of the same body is inside it [m].
_INSIDE = 1e-4


class RobotSurface:
    """Samples of the robot's collision geometry: the hulls of its bodies.

    Args:
        robot: The robot.
        spacing: Of samples, about [m].

    Raises:
        ConfigurationError: Its model has no collision geometry.
    """

    def __init__(self, robot: Robot, spacing: float = 0.012) -> None:
        from scipy.spatial import ConvexHull

        hulls = body_hulls(robot)
        if not hulls:
            raise ConfigurationError("calibrate-camera", "robot", robot.name, "a model with collision geometry")
        rng = np.random.default_rng(0)
        points, normals, bodies = [], [], []
        for body, _, vertices in hulls:
            hull = ConvexHull(vertices)
            corners = vertices[hull.simplices]
            areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
            count = max(int(np.ceil(hull.area / spacing**2)), 8)
            face = rng.choice(len(areas), size=count, p=areas / areas.sum())
            # uniformly on a triangle: fold the unit square
            a, b = rng.uniform(size=(2, count, 1))
            a, b = np.where(a + b > 1.0, 1.0 - a, a), np.where(a + b > 1.0, 1.0 - b, b)
            corner = corners[face]
            points.append(corner[:, 0] + a * (corner[:, 1] - corner[:, 0]) + b * (corner[:, 2] - corner[:, 0]))
            normals.append(hull.equations[face, :3])
            bodies.append(np.full(count, body))
        self._robot = robot
        self._points, self._normals = np.concatenate(points), np.concatenate(normals)
        self._bodies = np.concatenate(bodies)
        self._keep_outside()

    def _keep_outside(self) -> None:
        """Leave out what lies inside other hulls of the same body."""
        hulls, outside = body_hull_set(self._robot), np.ones(len(self._points), dtype=bool)
        for h, body in enumerate(hulls.bodies):
            planes = hulls.planes[hulls.first[h] : hulls.first[h + 1]]
            on = np.flatnonzero(self._bodies == body)
            height = (self._points[on] @ planes[:, :3].T + planes[:, 3]).max(axis=1)
            outside[on[height < -_INSIDE]] = False
        self._points, self._normals = self._points[outside], self._normals[outside]
        self._bodies = self._bodies[outside]

    def at(self, q: Array) -> tuple[Array, Array]:
        """Samples and outward normals (s, 3) each at a configuration (nq,), in the robot's base frame."""
        poses = self._robot.at(q).body_poses()[self._bodies]
        points = np.einsum("sij,sj->si", poses[:, :3, :3], self._points) + poses[:, :3, 3]
        return points, np.einsum("sij,sj->si", poses[:, :3, :3], self._normals)
