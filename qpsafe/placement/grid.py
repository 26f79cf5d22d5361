"""An equally spaced grid of points on a surface, and which of them look out freely.

On each of the six sides of a region (the axis nearest to the outward normal, and its sign) a square lattice is laid
across and brought onto the surface along that axis. On flat sides that is the grid. Where the surface is curved, and
where sides meet, lattices leave gaps or come too near to each other: points of a much finer lattice fill the gaps, and
a point is taken only if none taken before it is nearer than `NEAREST` times the spacing and looks the same way. So of
the points that look the same way (normals less than 90 degrees apart) no two are nearer than that, and no place of
the surface is farther than that from one (but for the pitch of the fine lattice).
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, add, cross, dot, entry, readable, row

#: Points that look the same way are no nearer to each other than this share of the spacing.
NEAREST = 0.95
#: Rays start this far off the surface [m]: what lies nearer, such as a second copy of it, is no obstacle.
OFF = 5e-4


def lattice(triangles: Array, normals: Array, box: Array, spacing: float) -> tuple[Array, Array]:
    """Points of square lattices on the six sides of a surface and the normals there, (k, 3) each.

    Args:
        triangles: (t, 3, 3) [m].
        normals: Outward, unit, (t, 3).
        box: Lower and upper corner of the box that the lattices lie in the middle of, (2, 3) [m].
        spacing: Of the lattice, measured across its side's axis [m].
    """
    axis = np.abs(normals).argmax(axis=1)
    sign = np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0.0
    points, outwards = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for a in range(3):
        across = [b for b in range(3) if b != a]
        for positive in (True, False):
            side = triangles[(axis == a) & (sign == positive)]
            if not len(side):
                continue
            places = _centred(np.clip(side, *box)[:, :, across].reshape(-1, 2), spacing)
            where, which = _above(places, side[:, :, across])
            found = np.empty((len(where), 3))
            n = normals[(axis == a) & (sign == positive)][which]
            found[:, across] = places[where]
            # the plane of the triangle: n . (x - corner) = 0, solved for the coordinate along the axis
            corner = side[which, 0]
            slope = (n[:, across] * (found[:, across] - corner[:, across])).sum(axis=1)
            found[:, a] = corner[:, a] - slope / n[:, a]
            points.append(found)
            outwards.append(n)
    return np.concatenate(points), np.concatenate(outwards)


def _centred(corners: Array, spacing: float) -> Array:
    """A square lattice that lies in the middle of the bounding box of some points, (k, 2)."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    counts = np.floor((high - low) / spacing + 1e-9).astype(int) + 1
    start = 0.5 * (low + high - (counts - 1) * spacing)
    u, v = (start[i] + spacing * np.arange(counts[i]) for i in (0, 1))
    return np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)


def _above(places: Array, flat: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs (place, triangle) of the places (k, 2) that lie in flat triangles (t, 3, 2)."""
    where, which = np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    for first in range(0, len(places), 4096):  # bounded memory
        i, j = _inside(places[first : first + 4096], flat)
        where, which = np.concatenate((where, i + first)), np.concatenate((which, j))
    return where, which


def _inside(places: Array, flat: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    a, u, v = flat[:, 0], flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    w = places[:, None, :] - a
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (w[..., 0] * v[:, 1] - w[..., 1] * v[:, 0]) / area
        t = (u[:, 0] * w[..., 1] - u[:, 1] * w[..., 0]) / area
        inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9)
    i, j = np.nonzero(inside)
    return i, j


def looks_out(points: Array, normals: Array, body: Array, reach: float) -> NDArray[np.bool_]:
    """Which points (k, 3) see nothing of their own body (t, 3, 3) along their normals within `reach` [m].

    A point inside another part of the body sees that part's far side, so buried points are out too.

    Args:
        points: (k, 3) [m].
        normals: Outwards (k, 3).
        body: Triangles (t, 3, 3) [m].
        reach: [m].
    """
    free = np.empty(len(points), dtype=np.bool_)
    _looks_out(points, normals, body, reach, free)
    return free


@entry(types.void(readable(2), readable(2), readable(3), types.float64, types.boolean[::1]))
def _looks_out(points: Array, normals: Array, body: Array, reach: float, free: NDArray[np.bool_]) -> None:
    for i in range(points.shape[0]):
        d = row(normals, i)
        start = add(row(points, i), OFF, d)
        free[i] = True
        for j in range(body.shape[0]):  # Moeller and Trumbore's intersection of a ray and a triangle
            a = row(body[j], 0)
            u, v, w = add(row(body[j], 1), -1.0, a), add(row(body[j], 2), -1.0, a), add(start, -1.0, a)
            p, q = cross(d, v), cross(w, u)
            volume = dot(p, u)
            s, t, distance = dot(w, p) / volume, dot(d, q) / volume, dot(v, q) / volume  # NaN, no hit, in the plane
            if s >= -1e-9 and t >= -1e-9 and s + t <= 1.0 + 1e-9 and 0.0 < distance < reach:
                free[i] = False
                break


def thin_out(points: Array, normals: Array, nearest: float) -> NDArray[np.intp]:
    """The points to keep, in order: none nearer than `nearest` [m] to an earlier one that looks the same way.

    Args:
        points: (k, 3) [m].
        normals: Outwards (k, 3).
        nearest: [m].
    """
    kept = np.empty(len(points), dtype=np.int64)
    count = np.zeros(1, dtype=np.int64)
    _thin_out(points, normals, nearest, kept, count)
    return kept[: count[0]]


@entry(types.void(readable(2), readable(2), types.float64, types.int64[::1], types.int64[::1]))
def _thin_out(points: Array, normals: Array, nearest: float, kept: Array, count: Array) -> None:
    for i in range(points.shape[0]):
        alone = True
        for k in range(count[0]):
            gap = add(row(points, i), -1.0, row(points, kept[k]))
            if dot(gap, gap) < nearest * nearest and dot(row(normals, i), row(normals, kept[k])) > 1e-9:
                alone = False
                break
        if alone:
            kept[count[0]] = i
            count[0] += 1
