"""How shapes lie in flat arrays: the columns of the tables that the kernels read.

A shape is a core with a margin around it, the form in which distances are easiest: a sphere is a point, a capsule a
segment, each with its radius as margin; all other kinds have none. Kinds have MuJoCo's numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = 0, 2, 3, 4, 5, 6, 7

#: Columns of the table of whole numbers, `index`: kind; body that carries the shape, 0 for the world; the scene's body;
#: whether rays see it; first vertex and how many; first plane and how many; first box of the tree of triangles and how
#: many. Only the kind, the body, vertices and planes matter to distances.
KIND, BODY, SCENE_BODY, SEEN, VERTEX, VERTICES, PLANES_FROM, PLANES, NODES_FROM, NODES = range(10)
INTEGERS = 10

#: Columns of the table of lengths, `shapes`: rows of the pose (3, 4) in the body; sizes as MuJoCo gives them; margin;
#: centre and half sizes of a box around it, in its own frame; centre, in the body's frame, and radius of a ball around
#: it.
POSE, SIZE, MARGIN, CASE, BALL = 0, 12, 15, 16, 22
FLOATS = 26


def describe(row: Array, kind: int, place: Array, size: Array, points: Array | None) -> None:
    """Fill a row of `shapes`.

    Args:
        row: (FLOATS,).
        kind: What it is.
        place: Pose in its body (4, 4) [m].
        size: As MuJoCo gives it (3,) [m].
        points: Vertices of a mesh in its own frame (v, 3) [m].
    """
    a, b, c = size
    half = {
        PLANE: (np.inf, np.inf, 0.0),
        SPHERE: (a, a, a),
        CAPSULE: (a, a, a + b),
        CYLINDER: (a, a, b),
    }.get(kind, (a, b, c))
    centre, radius = (
        np.zeros(3),
        {CYLINDER: np.hypot(a, b), BOX: np.linalg.norm(size)}.get(kind, max(half)),
    )
    if points is not None:
        low, high = points.min(axis=0), points.max(axis=0)
        centre, half = 0.5 * (low + high), tuple(0.5 * (high - low))
        radius = np.sqrt(((points - centre) ** 2).sum(axis=1)).max()
    row[POSE:SIZE] = place[:3].ravel()
    row[SIZE:MARGIN] = size
    row[MARGIN] = a if kind in (SPHERE, CAPSULE) else 0.0
    row[CASE:BALL] = *centre, *half
    row[BALL:] = *(place[:3, :3] @ centre + place[:3, 3]), radius


def frozen(values: Any, kind: Any = np.float64) -> NDArray[Any]:
    """An own, read-only copy, row by row in memory."""
    array = np.array(values, dtype=kind, order="C")
    array.flags.writeable = False
    return array
