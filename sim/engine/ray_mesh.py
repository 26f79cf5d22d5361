"""Where the rays of a cone meet a mesh first, compiled.

A convex mesh is the intersection of half-spaces; a ray is in it between the last plane that it enters by and the first
that it leaves by. Most planes cannot be either for any ray of a narrow cone: one pass over all planes sorts these out,
then each ray is clipped by the few that are left. The point itself is found on the triangles of the plane that is
entered, since a mesh's faces are flat only to about `BAND`.
"""

from __future__ import annotations

from math import inf

from qpsafe.compiled.compiled import Array, Vector, cross, dot, inline, row
from qpsafe.compiled.memory import view
from qpsafe.robot.kinematics import Index
from qpsafe.sim.engine.layout import PLANES, PLANES_FROM, TRIANGLES, TRIANGLES_FROM

EDGE = 1e-12  # by which triangles overlap, so that no ray slips between two
BAND = 1e-5  # more than planes stand off their triangles [m]


@inline
def ray_triangles(o: Vector, d: Vector, triangles: Array, first: int, last: int) -> float:
    """Distance along a ray to the nearest of some triangles, seen from either side; +inf if it meets none."""
    best = inf
    for i in range(first, last):
        e, f = (triangles[i, 3], triangles[i, 4], triangles[i, 5]), (triangles[i, 6], triangles[i, 7], triangles[i, 8])
        p = cross(d, f)
        area = dot(e, p)
        if area == 0.0:
            continue
        s = (o[0] - triangles[i, 0], o[1] - triangles[i, 1], o[2] - triangles[i, 2])
        q = cross(s, e)
        u, v, t = dot(s, p) / area, dot(d, q) / area, dot(f, q) / area
        if u >= -EDGE and v >= -EDGE and u + v <= 1.0 + EDGE and 0.0 <= t < best:
            best = t
    return best


@inline
def cone_mesh(
    o: Vector, fan: Array, sine: float, cosine: float, best: float, kind: Index, planes: Array, faces: Index,
    triangles: Array, work: Array,
) -> float:  # fmt: skip
    """The nearest point of a mesh along the rays `fan` (m, 3) from o, if nearer than `best`; mesh's frame.

    The rays after the first one make the angle α with it, of the given sine and cosine. Works in 4 numbers a plane.
    """
    first, count = kind[PLANES_FROM], kind[PLANES]
    kept = view(work, 0, (count, 4))
    axis, level, low, high, far = row(fan, 0), -inf, 0.0, 0.0, inf
    for k in range(count):
        n = row(planes, first + k)
        gap = dot(n, o) + planes[first + k, 3]
        # slopes n·d of the cone's rays lie between n·a cos α -+ sin α
        slope = cosine * dot(n, axis)
        least, most = slope - sine - 1e-12, slope + sine + 1e-12
        level = max(level, gap)
        if gap > 0.0:  # outside: rays enter, between early and late
            if least >= 0.0:
                return best
            early, late = -gap / least, -gap / most if most < 0.0 else inf
            low, high = max(low, early), max(high, late)
            if low > best:
                return best
        else:  # inside: rays leave
            early, late = -gap / most if most > 0.0 else inf, -gap / least if least > 0.0 else inf
            far = min(far, late)
        kept[k, 0], kept[k, 1], kept[k, 2] = gap, early, late
    if low > far:
        return best
    last = min(high, best) if level > 0.0 else far
    left = 0
    for k in range(count):
        gap = kept[k, 0]
        if kept[k, 2] >= low if gap > 0.0 else kept[k, 1] <= last:
            kept[left, 0], kept[left, 3] = gap, first + k
            left += 1

    for i in range(fan.shape[0]):
        d, near, leave, front, back = row(fan, i), 0.0, inf, -1, -1
        for k in range(left):
            gap, plane = kept[k, 0], int(kept[k, 3])
            slope = dot(row(planes, plane), d)
            if gap > 0.0:
                t = -gap / slope if slope < 0.0 else inf
                if t > near:
                    near, front = t, plane
            elif slope > 0.0:
                t = -gap / slope
                if t < leave:
                    leave, back = t, plane
        if near > leave or near > best:
            continue
        t, face = inf, front if level > 0.0 else back
        if face >= 0 and abs(level) > BAND:
            t = ray_triangles(o, d, triangles, faces[face], faces[face + 1])
        if t == inf:  # not convex, or where planes stand off the triangles
            t = ray_triangles(o, d, triangles, kind[TRIANGLES_FROM], kind[TRIANGLES_FROM] + kind[TRIANGLES])
        best = min(best, t)
    return best
