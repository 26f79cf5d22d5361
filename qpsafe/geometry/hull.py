"""A convex hull in flat arrays, for distances: its vertices, who is whose neighbour, and the planes of its faces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Hull(NamedTuple):
    """Tables of one convex hull in its own frame, or of several, one after the other.

    Attributes:
        vertices: (v, 3) [m].
        starts: First neighbour of each vertex, and how many there are in all, (v + 1,).
        neighbours: Vertices at the other ends of a vertex's edges.
        planes: Of the faces (n, b), n·x + b <= 0 inside, (p, 4).
    """

    vertices: Array
    starts: Index
    neighbours: Index
    planes: Array

    @classmethod
    def of(cls, points: Array) -> Hull:
        """The hull of points (n, 3) [m].

        Raises:
            scipy.spatial.QhullError: They do not span a volume.
        """
        from scipy.spatial import ConvexHull

        hull = ConvexHull(points)
        place = np.full(len(points), -1, dtype=np.int64)
        place[hull.vertices] = np.arange(len(hull.vertices))
        edges = np.vstack([place[hull.simplices][:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
        edges = np.unique(np.vstack((edges, edges[:, ::-1])), axis=0)
        _, first = np.unique(hull.equations.round(7), axis=0, return_index=True)  # triangles of one face have one plane
        return cls(
            points[hull.vertices],
            np.searchsorted(edges[:, 0], np.arange(len(hull.vertices) + 1)).astype(np.int64),
            edges[:, 1],
            hull.equations[np.sort(first)],
        )

    @classmethod
    def joined(cls, hulls: Sequence[Hull]) -> Hull:
        """The tables of several hulls, one after the other."""
        vertices = edges = 0
        starts, neighbours = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        for hull in hulls:
            starts.append(hull.starts[:-1] + edges)
            neighbours.append(hull.neighbours + vertices)
            vertices, edges = vertices + len(hull.vertices), edges + len(hull.neighbours)
        return cls(
            np.vstack([np.zeros((0, 3)), *(hull.vertices for hull in hulls)]),
            np.append(np.concatenate(starts), edges),
            np.concatenate(neighbours),
            np.vstack([np.zeros((0, 4)), *(hull.planes for hull in hulls)]),
        )
