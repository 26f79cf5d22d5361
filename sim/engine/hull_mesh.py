"""A mesh in flat arrays: its triangles sorted by face, its faces' planes, the vertices of its convex hull."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: How far vertices may stand out of a face of what counts as convex, as a share of the mesh's radius: MuJoCo keeps
#: vertices as float32 and its hulls have faces that are flat to about this.
FLAT = 1e-5


class HullMesh(NamedTuple):
    """Tables of one mesh, in its own frame.

    Attributes:
        vertices: Of its convex hull, (v, 3) [m].
        starts: First neighbour of each vertex in `neighbours`, (v + 1,).
        neighbours: Vertices at the other ends of a vertex's edges.
        planes: Outward planes (n, b) around the mesh, n·x + b <= 0 for all of it, (p, 4); none if it is not convex.
        faces: First triangle of each plane, and how many there are in all, (p + 1,).
        triangles: A corner and the two edges from it, plane by plane, (t, 9) [m].
    """

    vertices: Array
    starts: Index
    neighbours: Index
    planes: Array
    faces: Index
    triangles: Array


def hull_mesh(vertices: Array, triangles: Index) -> HullMesh:
    """Tables of a mesh; a mesh that is not convex keeps its triangles, and gets no planes.

    Args:
        vertices: (v, 3) [m]; they have to span a volume.
        triangles: Of which vertices, (t, 3).
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    corners, place = vertices[hull.vertices], np.full(len(vertices), -1, dtype=np.int64)
    place[hull.vertices] = np.arange(len(corners))
    edges = np.vstack([place[hull.simplices][:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    edges = np.unique(np.vstack((edges, edges[:, ::-1])), axis=0)
    starts = np.searchsorted(edges[:, 0], np.arange(len(corners) + 1))

    pieces = vertices[triangles]
    normals = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    areas = np.sqrt((normals**2).sum(axis=1))
    order = np.argsort(-areas, kind="stable")[: int((areas > 0.0).sum())]  # no ray meets a triangle without area
    pieces, normals = pieces[order], normals[order] / areas[order, None]
    normals *= np.where(((pieces[:, 0] - corners.mean(axis=0)) * normals).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    planes, owner = _planes(corners, pieces, normals)
    order = np.argsort(owner, kind="stable")
    pieces, owner = pieces[order], owner[order]
    return HullMesh(
        corners,
        starts.astype(np.int64),
        edges[:, 1],
        planes,
        np.append(np.searchsorted(owner, np.arange(len(planes))), len(owner)).astype(np.int64),
        np.hstack((pieces[:, 0], pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])),
    )


def joined(meshes: Sequence[HullMesh]) -> HullMesh:
    """The tables of several meshes, one after the other."""

    def shifted(parts: list[Index], steps: list[int], last: bool = False) -> Index:
        at = np.cumsum([0, *steps])
        rows = [part + place for part, place in zip(parts, at, strict=False)]
        return np.concatenate([*rows, at[-1:] if last else []]).astype(np.int64)

    return HullMesh(
        np.vstack([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes)]),
        shifted([mesh.starts[:-1] for mesh in meshes], [len(mesh.neighbours) for mesh in meshes], True),
        shifted([mesh.neighbours for mesh in meshes], [len(mesh.vertices) for mesh in meshes]),
        np.vstack([np.zeros((0, 4)), *(mesh.planes for mesh in meshes)]),
        shifted([mesh.faces[:-1] for mesh in meshes], [len(mesh.triangles) for mesh in meshes], True),
        np.vstack([np.zeros((0, 9)), *(mesh.triangles for mesh in meshes)]),
    )


def _planes(corners: Array, pieces: Array, normals: Array) -> tuple[Array, Index]:
    """Planes (p, 4) of a convex mesh, the largest triangles' first, and the plane of each triangle (t,)."""
    flat = FLAT * np.sqrt(((corners - corners.mean(axis=0)) ** 2).sum(axis=1)).max()
    heights = (corners @ normals.T).max(axis=0)  # of the hull over each triangle's plane: no more than the triangle's
    if (heights - (pieces * normals[:, None]).sum(axis=2).min(axis=1) > flat).any():
        return np.zeros((0, 4)), np.zeros(len(pieces), dtype=np.int64)
    owner = np.full(len(pieces), -1, dtype=np.int64)
    planes: list[list[float]] = []
    for i in range(len(pieces)):
        if owner[i] < 0:
            inside = ((pieces @ normals[i]) > heights[i] - flat).all(axis=1) & (normals @ normals[i] > 0.9)
            owner[inside & (owner < 0)] = len(planes)
            planes.append([*normals[i], -heights[i]])
    return np.array(planes), owner
