"""Capsules around a robot's collision hulls: what must not touch a person, slightly enlarged.

Where the model has no collision geometry, they are those of the robot's wire, without thickness.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FAT = 0.03  # a capsule that adds more than this to its hull is split [m]
PIECES = 4  # into no more than this


class Capsules(NamedTuple):
    """Capsules that contain hulls, each fixed to a body of the robot's tree.

    Attributes:
        bodies: (c,).
        names: Of the hulls they contain.
        ends: Of their axes, in the body's frame (c, 2, 3) [m].
        radii: (c,) [m].
        adds: By how much each stands out of its hull at most (c,) [m].
    """

    bodies: NDArray[np.int64]
    names: tuple[str, ...]
    ends: Array
    radii: Array
    adds: Array


def joined(some: Capsules, others: Capsules) -> Capsules:
    """All of them."""
    return Capsules(
        np.concatenate((some.bodies, others.bodies)),
        some.names + others.names,
        np.concatenate((some.ends, others.ends)),
        np.concatenate((some.radii, others.radii)),
        np.concatenate((some.adds, others.adds)),
    )


def capsules_of(hulls: Sequence[tuple[int, str, Array]]) -> Capsules:
    """Capsules around hulls that move; those of body 0, the base, approach nobody.

    Args:
        hulls: Body, name, vertices (v, 3) [m] of each.
    """
    bodies: list[int] = []
    names: list[str] = []
    found: list[tuple[Array, float, float]] = []
    for body, name, vertices in hulls:
        if body == 0:
            continue
        for one in _around(np.asarray(vertices, dtype=float).tobytes()):
            bodies.append(body)
            names.append(name)
            found.append(one)
    return Capsules(
        np.array(bodies, dtype=np.int64),
        tuple(names),
        np.array([ends for ends, _, _ in found]).reshape(-1, 2, 3),
        np.array([radius for _, radius, _ in found]),
        np.array([adds for _, _, adds in found]),
    )


@lru_cache(maxsize=512)
def _around(vertices: bytes) -> list[tuple[Array, float, float]]:
    """Capsules (ends, radius, what it adds) around a hull: as few as add no more than `FAT`, at most `PIECES`.

    Made once: whoever loads a robot again has the same links.
    """
    points = np.frombuffer(vertices).reshape(-1, 3)
    best: list[tuple[Array, float, float]] = []
    for count in range(1, PIECES + 1):
        pieces = _cut(points, count)
        capsules = [(*capsule_around(piece), piece) for piece in pieces]
        told = [(ends, radius, _adds(ends, radius, piece)) for ends, radius, piece in capsules]
        if not best or max(c[2] for c in told) < 0.8 * max(c[2] for c in best):
            best = told
        if max(c[2] for c in told) <= FAT:
            break
    return best


def _cut(points: Array, count: int) -> list[Array]:
    """A hull cut across its longest side into pieces of equal length."""
    if count == 1:
        return [points]
    from scipy.spatial import ConvexHull

    axis = _axes(points)[0]
    edges = {
        tuple(sorted((int(a), int(b))))
        for s in ConvexHull(points).simplices
        for a, b in ((s[0], s[1]), (s[1], s[2]), (s[2], s[0]))
    }
    height = points @ axis
    cuts = np.linspace(height.min(), height.max(), count + 1)
    pieces = []
    for low, high in pairwise(cuts):
        inside = [points[(height >= low) & (height <= high)]]
        for plane in (low, high):
            for a, b in edges:
                ha, hb = height[a], height[b]
                if (ha - plane) * (hb - plane) < 0.0:
                    inside.append((points[a] + (plane - ha) / (hb - ha) * (points[b] - points[a]))[None])
        pieces.append(np.vstack(inside))
    return pieces


def _axes(points: Array) -> Array:
    """Principal axes, longest first, (3, 3)."""
    off = points - points.mean(axis=0)
    axes: Array = np.linalg.eigh(off.T @ off)[1].T[::-1]
    return axes


def capsule_around(points: Array) -> tuple[Array, float]:
    """Ends (2, 3), radius [m] of the smallest of some capsules around points: along their axes and the frame's."""
    best, ends, radius = np.inf, np.zeros((2, 3)), 0.0
    axes = np.vstack((_axes(points), np.eye(3)))
    for axis, centre, r in zip(axes, *_circles(points, axes), strict=True):
        off = points - centre
        along = off @ axis
        across = np.linalg.norm(off - np.outer(along, axis), axis=1)
        cap = np.sqrt(np.maximum(r * r - across * across, 0.0))
        low, high = float((along + cap).min()), float((along - cap).max())  # every point within r of the axis' ends
        if low > high:  # a ball
            low = high = 0.5 * (low + high)
            r = max(r, float(np.hypot(across, along - low).max()))
        volume = np.pi * r * r * (high - low) + 4.0 / 3.0 * np.pi * r**3
        if volume < best:
            best, radius, ends = volume, r, centre + np.outer((low, high), axis)
    nearest = np.linalg.norm(points - _on_axis(points, ends), axis=1)
    return ends, float(max(radius, nearest.max()))  # contains them whatever rounding did


def _circles(points: Array, axes: Array) -> tuple[Array, Array]:
    """Centres, radii of small cylinders along axes (k, 3) around points, moved towards the farthest (Badoiu)."""
    flat = points - (axes @ points.T)[:, :, None] * axes[:, None]  # (k, v, 3)
    centres = 0.5 * (flat.min(axis=1) + flat.max(axis=1))
    every = np.arange(len(axes))
    for step in range(1, 80):
        away = flat - centres[:, None]
        far = np.einsum("kvc,kvc->kv", away, away).argmax(axis=1)
        centres = centres + away[every, far] / (step + 1.0)
    return centres, np.linalg.norm(flat - centres[:, None], axis=2).max(axis=1)


def _on_axis(points: Array, ends: Array) -> Array:
    d = ends[1] - ends[0]
    dd = float(d @ d)
    t = np.clip((points - ends[0]) @ d / dd, 0.0, 1.0) if dd > 0.0 else np.zeros(len(points))
    return ends[0] + np.outer(t, d)


def _adds(ends: Array, radius: float, points: Array) -> float:
    """How far the capsule's surface is from the hull at most, over many directions."""
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(400, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    of_capsule = np.maximum(normals @ ends[0], normals @ ends[1]) + radius
    return float((of_capsule - (normals @ points.T).max(axis=1)).max())
