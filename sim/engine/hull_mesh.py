"""A mesh in flat arrays: its convex hull for distances, and its triangles in a tree of boxes for rays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.geometry.hull import Hull

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LEAF = 2  # triangles in a box of the tree that is not divided further


class HullMesh(NamedTuple):
    """Tables of one mesh, in its own frame, or of several, one after the other.

    Attributes:
        hull: Of its vertices.
        boxes: Centre and half sizes of boxes around triangles, (m, 6) [m]. A box is followed by those inside it.
        nodes: Of each box where to go on if it is missed; its first triangle and how many it has itself, (m, 3).
        triangles: A corner and the two edges from it, box by box, (t, 9) [m].
    """

    hull: Hull
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
    pieces = vertices[triangles]
    boxes, nodes, order = _tree(pieces)
    a, b, c = pieces[order].transpose(1, 0, 2)
    return HullMesh(Hull.of(vertices), boxes, nodes, np.hstack((a, b - a, c - a)))


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
    boxes = triangles = 0
    nodes = [np.zeros((0, 3), dtype=np.int64)]
    for mesh in meshes:
        nodes.append(mesh.nodes + np.array([boxes, triangles, 0]))
        boxes, triangles = boxes + len(mesh.boxes), triangles + len(mesh.triangles)
    return HullMesh(
        Hull.joined([mesh.hull for mesh in meshes]),
        np.vstack([np.zeros((0, 6)), *(mesh.boxes for mesh in meshes)]),
        np.concatenate(nodes),
        np.vstack([np.zeros((0, 9)), *(mesh.triangles for mesh in meshes)]),
    )
