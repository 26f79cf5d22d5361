"""Images against what a camera at a pose would see: how well they agree, and the pose at which they agree best.

Registration by nearest points is drawn towards the robot by the noise of its images; along the rays there is none of
that. For a ray u that reads d and should read d̂, on a face with normal n, the residual is d - d̂, and a small motion
(v, ω) of the pose changes it by (n·v + ((p - c) × n)·ω)/(n·u).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.ranging.extrinsics.cast import cast
from qpsafe.ranging.extrinsics.register import moved
from qpsafe.sensing.body import body_hull_set

if TYPE_CHECKING:
    from qpsafe.ranging.extrinsics.moving import Moving
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: A ray that grazes a face with less than this, |n·u|, is not used: an edge, mostly.
_GRAZING = 0.2
#: Steps at each width, and what a pose that has been found moves by in one at most [m, rad].
_STEPS, _STILL = 6, 1e-6


class View(NamedTuple):
    """How images agree with what should be seen from a pose.

    Attributes:
        rows: Of the residuals by (v, ω) about `centre`, with weights (k, 6).
        residuals: (k,) [m].
        weights: (k,).
        images: Whose each is (k,).
        centre: Of the places that were seen (3,) [m].
        radius: Root mean square distance from it [m].
        explained: Share of what moves that is seen where the robot should be.
        through: Share of the rays that should meet the robot, but read something farther.
    """

    rows: Array
    residuals: Array
    weights: Array
    images: NDArray[np.int64]
    centre: Array
    radius: float
    explained: float
    through: float

    @property
    def wrong(self) -> float:
        """0 where everything agrees."""
        return 1.0 - self.explained + self.through


class Views:
    """The images of a recording, as rays of which those that see something moving are marked.

    Args:
        robot: The robot.
        q: Its joints at each image (n, nq).
        moving: What moves in the images.
    """

    def __init__(self, robot: Robot, q: Array, moving: Moving) -> None:
        self._tables = body_hull_set(robot).tables
        self._poses = [np.ascontiguousarray(robot.at(row).body_poses()) for row in q]
        self._moving = moving

    def at(self, pose: Array, width: float) -> View:
        """How the images agree with a pose.

        Args:
            pose: Of the camera (4, 4).
            width: Of Tukey's weights, where noise is less [m].
        """
        rows, residuals, weights, places, images = [], [], [], [], []
        met, moves, should, through = 0, 0, 0, 0
        pose = np.ascontiguousarray(pose)
        for image, bodies in enumerate(self._poses):
            rays = self._moving.rays[image]
            expected, normals = np.empty(len(rays.directions)), np.zeros((len(rays.directions), 3))
            cast(pose, rays.directions, bodies, *self._tables, expected, normals)
            hit = np.isfinite(expected)
            wide = np.maximum(width, 4.0 * rays.sigma)
            off = np.where(hit, rays.distances - np.where(hit, expected, 0.0), np.inf)
            near = hit & (np.abs(off) < wide)
            met += int((near & rays.moving).sum())
            moves += int(rays.moving.sum())
            should += int(hit.sum())
            through += int((hit & (off >= wide)).sum())
            u = rays.directions @ pose[:3, :3].T
            slope = np.einsum("kj,kj->k", normals, u)
            use = near & (slope < -_GRAZING)
            n = normals[use] / slope[use, None]
            p = pose[:3, 3] + rays.distances[use, None] * u[use]
            part = 1.0 - (off[use] / wide[use]) ** 2
            rows.append(n)
            residuals.append(off[use])
            weights.append((part * self._moving.least / rays.sigma[use]) ** 2)
            places.append(p)
            images.append(np.full(len(p), image))
        p, n = np.concatenate(places), np.concatenate(rows)
        w, r = np.concatenate(weights), np.concatenate(residuals)
        centre = np.average(p, axis=0, weights=w) if len(p) and w.sum() > 0.0 else pose[:3, 3]
        radius = float(np.sqrt(((p - centre) ** 2).sum(axis=1).mean())) if len(p) else 1.0
        return View(
            np.hstack((n, np.cross(p - centre, n))), r, w, np.concatenate(images), centre, max(radius, 1e-6),
            met / max(moves, 1), through / max(should, 1),
        )  # fmt: skip

    def refine(self, pose: Array, widths: tuple[float, ...] = (0.08, 0.04)) -> tuple[Array, View]:
        """The pose (4, 4) at which the images agree best, from one nearby.

        Args:
            pose: To begin with (4, 4).
            widths: Of the weights, one after the other [m].
        """
        for width in widths:
            for _ in range(_STEPS):
                view = self.at(pose, width)
                if len(view.residuals) < 6:
                    break
                scale = np.r_[1.0, 1.0, 1.0, [view.radius] * 3]
                J = view.rows / scale
                H = (J * view.weights[:, None]).T @ J
                H += 1e-6 * np.trace(H) * np.eye(6)  # so that what is not observed stays
                step = -np.linalg.solve(H, J.T @ (view.weights * view.residuals)) / scale
                pose = moved(pose, step, view.centre)
                if np.abs(step).max() < _STILL:
                    break
        return pose, self.at(pose, widths[-1])
