"""A first pose without any guess: where what moves in the images is, against where the robot's moving parts are.

The centroid of what moves, image by image, follows that of the robot's moving surface, but for the side that the camera
does not see. The rigid motion between the two trajectories (Kabsch) is right within a decimetre or so; about an axis
along which the centroids lie it is not known at all. So poses turned about that axis are tried, too, and those that
fit best are registered. Where that leads nowhere, since somebody else walks through the images or there are few of
them, poses all around the robot are tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from qpsafe.ranging.cell_cameras import looking
from qpsafe.ranging.extrinsics.register import Registration, moved

if TYPE_CHECKING:
    from qpsafe.ranging.extrinsics.views import Views

Array = NDArray[np.float64]

#: Poses turned about the axis of the centroids, and about the vertical, that are tried, and how many of all are
#: registered further.
TURNS, UPRIGHT, KEPT = 12, 8, 4
#: Heights above the robot [rad] and directions from which it is looked at where nothing else helps.
_RISES, _AROUND = (-0.3, 0.1, 0.5, 0.9, 1.4), 24
#: They are judged by nearest points within this first [m], and so many of them are registered.
_WIDE, _REFINED = 0.5, 32
#: Within this of what should be read, an image agrees with a rough pose [m].
_AGREES = 0.15
#: A part has moved if the robot is not within a distance of it in many other images: this share of the most there are
#: for any part [m].
_SHARE, _APART = 0.5, 0.03
#: Points of an image that are tried, and the widths of it.
_FEW = 60
_ROUGH = ((0.30, 6), (0.15, 4))
#: Of the trajectories at which RANSAC calls a pair of centroids good [m].
_GOOD = 0.15
_UP = np.array([0.0, 0.0, 1.0])


def first_poses(
    points: Sequence[Array], surfaces: Sequence[tuple[Array, Array]], views: Views, seed: int = 0
) -> list[Array]:
    """Poses (4, 4) to begin with, the best first.

    Args:
        points: What moves in each image, in the camera's frame (k, 3) [m].
        surfaces: Samples and normals of the robot at each, in its base frame.
        views: The images, to choose by.
        seed: Of what is chosen at random.
    """
    rng = np.random.default_rng(seed)
    parts = _moving_parts(surfaces)
    good = [i for i in range(len(points)) if len(points[i]) >= 10 and len(parts[i][0]) >= 10]
    if len(good) < 4:
        return poses_around(points, surfaces, views, seed)
    seen = np.array([points[i].mean(axis=0) for i in good])
    there = np.array([parts[i][0].mean(axis=0) for i in good])
    pose = _ransac(seen, there, rng)
    for _ in range(3):  # the side that the camera sees, from about there
        there = np.array([_facing(parts[i], pose).mean(axis=0) for i in good])
        pose = _ransac(seen, there, rng)
    few = [x[rng.choice(len(x), size=min(len(x), _FEW), replace=False)] for x in points]
    rough = Registration(few, [(s[::5], n[::5]) for s, n in surfaces])
    centre = there.mean(axis=0)
    axis = np.linalg.svd(there - centre)[2][0]
    turns = [(axis, turn / TURNS) for turn in range(TURNS)] + [(_UP, turn / UPRIGHT) for turn in range(1, UPRIGHT)]
    tried: list[Any] = []
    for k, (about, part) in enumerate(turns):
        step = np.concatenate((np.zeros(3), 2.0 * np.pi * part * about))
        found, _ = rough.refine(moved(pose, step, centre), _ROUGH)
        tried.append((views.at(found, _AGREES).wrong, k, found))
    tried.sort(key=lambda entry: entry[:2])
    return [found for _, _, found in tried[:KEPT]]


def poses_around(
    points: Sequence[Array], surfaces: Sequence[tuple[Array, Array]], views: Views, seed: int = 0
) -> list[Array]:
    """Poses all around the robot, in which what moves is before it; those that agree best with the images.

    Args:
        points: What moves in each image, in the camera's frame (k, 3) [m].
        surfaces: Samples and normals of the robot at each, in its base frame.
        views: The images, to choose by.
        seed: Of what is chosen at random.
    """
    rng = np.random.default_rng(seed)
    few = [x[rng.choice(len(x), size=min(len(x), _FEW // 3), replace=False)] for x in points]
    rough = Registration(few, [(samples[::16], normals[::16]) for samples, normals in surfaces])
    seen = np.median(np.concatenate(points), axis=0)
    there = np.concatenate([samples for samples, _ in _moving_parts(surfaces)]).mean(axis=0)
    tried: list[Any] = []
    for rise in _RISES:
        for turn in range(_AROUND):
            around = 2.0 * np.pi * turn / _AROUND
            away = np.array([np.cos(rise) * np.cos(around), np.cos(rise) * np.sin(around), np.sin(rise)])
            for roll in range(4):
                pose = looking(there + np.linalg.norm(seen) * away, there)
                c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[roll]
                R = pose[:3, :3] @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
                pose[:3, :3], pose[:3, 3] = R, there - R @ seen
                tried.append((rough.match(pose, _WIDE).cost, len(tried), pose))
    tried.sort(key=lambda entry: entry[:2])
    better = [(rough.refine(pose, _ROUGH)[0], k) for _, k, pose in tried[:_REFINED]]
    found = sorted((views.at(pose, _AGREES).wrong, k, pose) for pose, k in better)
    return [pose for _, _, pose in found[: 2 * KEPT]]


def kabsch(seen: Array, there: Array) -> Array:
    """The pose (4, 4) that takes points (k, 3) to others with the least squares."""
    a, b = seen.mean(axis=0), there.mean(axis=0)
    U, _, Vt = np.linalg.svd((seen - a).T @ (there - b))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))])
    pose = np.eye(4)
    pose[:3, :3] = Vt.T @ mirror @ U.T
    pose[:3, 3] = b - pose[:3, :3] @ a
    return pose


def _ransac(seen: Array, there: Array, rng: np.random.Generator) -> Array:
    best, most = kabsch(seen, there), -1
    for _ in range(200):
        three = rng.choice(len(seen), size=3, replace=False)
        pose = kabsch(seen[three], there[three])
        off = np.linalg.norm(seen @ pose[:3, :3].T + pose[:3, 3] - there, axis=1)
        good = off < _GOOD
        if good.sum() > most and good.sum() >= 4:
            most, best = int(good.sum()), kabsch(seen[good], there[good])
    return best


def _moving_parts(surfaces: Sequence[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """Samples where the robot is not in most of the other images, and their normals."""
    thin = [(samples[::8], normals[::8]) for samples, normals in surfaces]
    trees, found = [cKDTree(samples) for samples, _ in thin], []
    for i, (samples, normals) in enumerate(thin):
        away = np.zeros(len(samples))
        for k, tree in enumerate(trees):
            if k != i:
                away += tree.query(samples, distance_upper_bound=_APART)[0] > _APART
        moves = away >= _SHARE * away.max(initial=1.0)
        found.append((samples[moves], normals[moves]))
    return found


def _facing(part: tuple[Array, Array], pose: Array) -> Array:
    samples, normals = part
    faces = np.einsum("sj,sj->s", normals, pose[:3, 3] - samples) > 0.0
    return samples[faces] if faces.any() else samples
