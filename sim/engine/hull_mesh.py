"""A mesh in flat arrays: its triangles in a tree of boxes for rays, and its convex hull for distances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LEAF = 2  # triangles in a box of the tree that is not divided further


class HullMesh(NamedTuple):
    """Tables of one mesh, in its own frame.

    Attributes:
        vertices: Of its convex hull, (v, 3) [m].
        starts: First neighbour of each vertex, and how many there are in all, (v + 1,).
        neighbours: Vertices at the other ends of a vertex's edges.
        planes: Of the hull's faces (n, b), n·x + b <= 0 inside, (p, 4).
        boxes: Centre and half sizes of boxes around triangles, (m, 6) [m]. A box is followed by those inside it.
        nodes: Of each box where to go on if it is missed; its first triangle and how many it has itself, (m, 3).
        triangles: A corner and the two edges from it, box by box, (t, 9) [m].
    """

    vertices: Array
    starts: Index
    neighbours: Index
    planes: Array
    boxes: Array
    nodes: Index
    triangles: Array


def hull_mesh(vertices: Array, triangles: Index) -> HullMesh:
    """Tables of a mesh: rays meet its triangles, distances are those of its convex hull.

    Args:
        vertices: (v, 3) [m].
        triangles: Of which vertices, (t, 3).

    Raises:
        scipy.spatial.QhullError: The vertices do not span a volume.
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    place = np.full(len(vertices), -1, dtype=np.int64)
    place[hull.vertices] = np.arange(len(hull.vertices))
    edges = np.vstack([place[hull.simplices][:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    edges = np.unique(np.vstack((edges, edges[:, ::-1])), axis=0)
    _, first = np.unique(hull.equations.round(7), axis=0, return_index=True)  # triangles of one face have one plane
    pieces = vertices[triangles]
    boxes, nodes, order = _tree(pieces)
    a, b, c = pieces[order].transpose(1, 0, 2)
    return HullMesh(
        vertices[hull.vertices],
        np.searchsorted(edges[:, 0], np.arange(len(hull.vertices) + 1)).astype(np.int64),
        edges[:, 1],
        hull.equations[np.sort(first)],
        boxes,
        nodes,
        np.hstack((a, b - a, c - a)),
    )


def _tree(pieces: Array) -> tuple[Array, Index, Index]:
    """Boxes, nodes, and the order of the triangles (t, 3, 3): halved along the longest side of what is left."""
    low, high = pieces.min(axis=1), pieces.max(axis=1)
    middles = 0.5 * (low + high)
    boxes: list[Array] = []
    nodes: list[list[int]] = []
    order: list[int] = []

    def grow(chosen: Index) -> None:
        below, above = low[chosen].min(axis=0), high[chosen].max(axis=0)
        at, leaf = len(nodes), len(chosen) <= LEAF
        boxes.append(np.concatenate((0.5 * (below + above), 0.5 * (above - below))))
        nodes.append([0, len(order), len(chosen) if leaf else 0])
        if leaf:
            order.extend(chosen.tolist())
        else:
            side = int(np.argmax(np.ptp(middles[chosen], axis=0)))
            chosen = chosen[np.argsort(middles[chosen, side], kind="stable")]
            grow(chosen[: len(chosen) // 2])
            grow(chosen[len(chosen) // 2 :])
        nodes[at][0] = len(nodes)

    grow(np.arange(len(pieces)))
    return np.array(boxes), np.array(nodes, dtype=np.int64), np.array(order, dtype=np.int64)


def joined(meshes: Sequence[HullMesh]) -> HullMesh:
    """The tables of several meshes, one after the other."""
    vertices, edges, boxes, triangles = np.zeros(4, dtype=np.int64)
    starts, neighbours, nodes = [], [], []
    for mesh in meshes:
        starts.append(mesh.starts[:-1] + edges)
        neighbours.append(mesh.neighbours + vertices)
        nodes.append(mesh.nodes + np.array([boxes, triangles, 0]))
        vertices, edges = vertices + len(mesh.vertices), edges + len(mesh.neighbours)
        boxes, triangles = boxes + len(mesh.boxes), triangles + len(mesh.triangles)
    empty = np.zeros(0, dtype=np.int64)
    return HullMesh(
        np.vstack([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes)]),
        np.append(np.concatenate([empty, *starts]), edges),
        np.concatenate([empty, *neighbours]),
        np.vstack([np.zeros((0, 4)), *(mesh.planes for mesh in meshes)]),
        np.vstack([np.zeros((0, 6)), *(mesh.boxes for mesh in meshes)]),
        np.concatenate([empty.reshape(0, 3), *nodes]),
        np.vstack([np.zeros((0, 9)), *(mesh.triangles for mesh in meshes)]),
    )
