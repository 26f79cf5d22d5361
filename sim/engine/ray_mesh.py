"""Where the rays of a cone meet a mesh first, compiled.

The mesh's triangles lie in a tree of boxes. A box is looked into if the cone's axis meets it when it is grown by as
much as the cone is wide where the box ends; so the tree is gone through once for all rays of a cone.
"""

from __future__ import annotations

from math import inf

from qpsafe.compiled.compiled import Array, Vector, cross, dot, inline, row
from qpsafe.robot.kinematics import Index
from qpsafe.sim.engine.ray_shapes import box_span, inverse

EDGE = 1e-12  # by which triangles overlap, so that no ray slips between two


@inline
def ray_triangle(o: Vector, d: Vector, triangles: Array, i: int) -> float:
    """Distance along a ray to a triangle, seen from either side; +inf if it does not meet it."""
    e, f = (triangles[i, 3], triangles[i, 4], triangles[i, 5]), (triangles[i, 6], triangles[i, 7], triangles[i, 8])
    p = cross(d, f)
    area = dot(e, p)
    if area == 0.0:
        return inf
    s = (o[0] - triangles[i, 0], o[1] - triangles[i, 1], o[2] - triangles[i, 2])
    u = dot(s, p) / area
    if not -EDGE <= u <= 1.0 + EDGE:
        return inf
    q = cross(s, e)
    v, t = dot(d, q) / area, dot(f, q) / area
    return t if v >= -EDGE and u + v <= 1.0 + EDGE and t >= 0.0 else inf


@inline
def cone_mesh(
    o: Vector, fan: Array, sine: float, best: float, first: int, last: int, boxes: Array, nodes: Index, triangles: Array
) -> float:
    """The nearest point of a mesh along the rays `fan` (m, 3) from o, if nearer than `best`; mesh's frame.

    The rays after the first one make the angle α with it, of the given sine. The mesh's tree is `first` to `last`.
    """
    a, node = row(fan, 0), first
    inv, size = inverse(a), (abs(a[0]), abs(a[1]), abs(a[2]))
    while node < last:
        p = (o[0] - boxes[node, 0], o[1] - boxes[node, 1], o[2] - boxes[node, 2])
        h = (boxes[node, 3], boxes[node, 4], boxes[node, 5])
        # no point of the box is farther than this along the axis, and a ray is r sin α from the axis r along itself;
        # r <= (length along the axis) / cos α, which 2 covers up to a cone of 120 degrees
        along = dot(size, h) - dot(p, a)
        wide = min(best, 2.0 * max(along, 0.0)) * sine + 1e-9
        near, far = box_span(p, inv, h[0] + wide, h[1] + wide, h[2] + wide)
        if near > far or far < 0.0 or near > best:
            node = nodes[node, 0]
            continue
        for i in range(nodes[node, 1], nodes[node, 1] + nodes[node, 2]):
            for k in range(fan.shape[0]):
                best = min(best, ray_triangle(o, row(fan, k), triangles, i))
        node += 1
    return best
