"""Registration: the pose at which what moves in the images lies on the robot's surface, point to plane.

With p = T x the place of a point x of the camera, s the nearest sample of the surface that faces the camera and n its
normal, the residual is r = n·(p - s). A small motion of the pose, v and ω about the points' centroid c, changes it by
n·v + ((p - c) × n)·ω. Residuals are weighted by Tukey's function of r over a width that shrinks from step to step, so
that what is no robot stops counting.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Widths of the weights, and steps at each [m].
SCHEDULE = ((0.30, 4), (0.15, 4), (0.08, 5), (0.05, 5), (0.03, 8))
#: A pose that moves by less than that in a step has been found [m, rad].
_STILL = 1e-6


class Match(NamedTuple):
    """The residuals of a pose.

    Attributes:
        rows: Of the residuals by (v, ω), with weights (k, 6).
        residuals: (k,) [m].
        weights: (k,).
        images: Whose each is (k,).
        centre: The points' centroid c (3,) [m].
        radius: Root mean square distance of the points from it [m].
        cost: Mean of Tukey's function over all points, from 0 to 1: 1 for what is not near the robot at all.
    """

    rows: Array
    residuals: Array
    weights: Array
    images: NDArray[np.int64]
    centre: Array
    radius: float
    cost: float


class Registration:
    """Registers points of several images with the robot's surface at each.

    Args:
        points: Of each image, in the camera's frame, (k, 3) each [m].
        surfaces: Samples and normals at each image, in the robot's base frame, ((s, 3), (s, 3)) each.
    """

    def __init__(self, points: Sequence[Array], surfaces: Sequence[tuple[Array, Array]]) -> None:
        self._points, self._surfaces = list(points), list(surfaces)

    def facing(self, place: Array) -> list[tuple[Any, Array]]:
        """Of each image: what of the robot faces a camera at a place (3,), as a tree of samples, and its normals."""
        from scipy.spatial import cKDTree

        found = []
        for samples, normals in self._surfaces:
            faces = np.einsum("sj,sj->s", normals, place - samples) > 0.0
            found.append((cKDTree(samples[faces]), normals[faces]))
        return found

    def match(self, pose: Array, width: float, facing: Sequence[tuple[Any, Array]] | None = None) -> Match:
        """Residuals at a pose, with weights of a width.

        Args:
            pose: Of the camera (4, 4).
            width: [m].
            facing: As `facing` tells for about that pose.
        """
        places, outward, residuals, images, outside, total = [], [], [], [], 0, 0
        if facing is None:
            facing = self.facing(pose[:3, 3])
        for image, (x, (tree, normals)) in enumerate(zip(self._points, facing, strict=True)):
            total += len(x)
            if not len(x) or not tree.n:
                continue
            p = x @ pose[:3, :3].T + pose[:3, 3]
            distance, nearest = tree.query(p, distance_upper_bound=width)
            near = distance < np.inf
            outside += int((~near).sum())
            p, nearest = p[near], nearest[near]
            places.append(p)
            outward.append(normals[nearest])
            residuals.append(np.einsum("kj,kj->k", normals[nearest], p - tree.data[nearest]))
            images.append(np.full(len(p), image))
        if not sum(map(len, places)):
            return Match(np.zeros((0, 6)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros(3), 1.0, 1.0)
        p, n, r = np.concatenate(places), np.concatenate(outward), np.concatenate(residuals)
        part = np.clip(1.0 - (r / width) ** 2, 0.0, None)
        weights = part**2
        centre = np.average(p, axis=0, weights=weights) if weights.sum() > 0.0 else p.mean(axis=0)
        rows = np.hstack((n, np.cross(p - centre, n)))
        cost = (float((1.0 - part**3).sum()) + outside) / max(total, 1)
        radius = float(np.sqrt(((p - centre) ** 2).sum(axis=1).mean()))
        return Match(rows, r, weights, np.concatenate(images), centre, max(radius, 1e-6), cost)

    def refine(self, pose: Array, schedule: Sequence[tuple[float, int]] = SCHEDULE) -> tuple[Array, Match]:
        """The pose (4, 4) found from a first one, and its residuals at the last width.

        Args:
            pose: To begin with (4, 4).
            schedule: Widths [m] and steps.
        """
        for width, steps in schedule:
            facing = self.facing(pose[:3, 3])
            for _ in range(steps):
                match = self.match(pose, width, facing)
                if len(match.residuals) < 6:
                    break
                # a little damping, so that what is not observed stays
                scaled = match.rows / np.r_[1.0, 1.0, 1.0, [match.radius] * 3]
                H = (scaled * match.weights[:, None]).T @ scaled
                H += 1e-6 * np.trace(H) * np.eye(6)
                g = scaled.T @ (match.weights * match.residuals)
                step = -np.linalg.solve(H, g) / np.r_[1.0, 1.0, 1.0, [match.radius] * 3]
                pose = moved(pose, step, match.centre)
                if np.abs(step).max() < _STILL:
                    break
        return pose, self.match(pose, schedule[-1][0])


def moved(pose: Array, step: Array, centre: Array) -> Array:
    """A pose moved by v and turned by ω about a place, step = (v, ω) (6,).

    Args:
        pose: (4, 4).
        step: [m, rad].
        centre: (3,) [m].
    """
    from scipy.spatial.transform import Rotation

    R = Rotation.from_rotvec(step[3:]).as_matrix()
    result = np.eye(4)
    result[:3, :3] = R @ pose[:3, :3]
    result[:3, 3] = R @ (pose[:3, 3] - centre) + centre + step[:3]
    return result
