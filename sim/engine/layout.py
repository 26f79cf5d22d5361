"""How shapes lie in flat arrays: the columns of the tables that the kernels read.

A shape is a core with a margin around it, the form in which distances are easiest: a sphere is a point, a capsule a
segment, each with its radius as margin; all other kinds have none. Kinds have MuJoCo's numbers.
"""

from __future__ import annotations

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = 0, 2, 3, 4, 5, 6, 7

#: Columns of `World.index`: kind; body that carries the shape, 0 for the world; the scene's body; whether rays see it;
#: first vertex and how many; first plane and how many; first box of the tree of triangles and how many.
KIND, BODY, SCENE_BODY, SEEN, VERTEX, VERTICES, PLANES_FROM, PLANES, NODES_FROM, NODES = range(10)
INTEGERS = 10

#: Columns of `World.shapes`: rows of the pose (3, 4) in the body; sizes as MuJoCo gives them; margin; centre and half
#: sizes of a box around it, in its own frame; centre, in the body's frame, and radius of a ball around it.
POSE, SIZE, MARGIN, CASE, BALL = 0, 12, 15, 16, 22
FLOATS = 26
