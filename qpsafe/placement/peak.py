"""The largest static danger field on a person: max SDF(q, r_j) of eq. (12), over the whole surface, with a proof.

The static field, S(p) = sum over links of ∫ dl/R(l), is harmonic off the wire, so its maximum over a capsule lies on
the capsule's surface. The surface is cut into patches (four quarters of the cylinder, six faces of a cube around each
round end), and patches are halved until none can hold more than (1 + `TOLERANCE`) times the largest value found:
branch and bound. The bound of a patch with centre c, outward normal n, radius of the capsule r, all points within ρ of
c, at distance D from the wire and ∇S split into its tangential and normal part, is

    S(c) + |∇S_t| ρ + max(0, -∇S_n) ρ²/(2 r) + ρ² S(c) D/(D - ρ)³,

since a displacement on a convex surface of curvature at most 1/r leaves the tangent plane inwards by at most ρ²/(2r),
and the second derivative of 1/R is at most 2/R³ in size. Where ρ >= D/2, S(c) D/(D - ρ) or infinity takes its place.
"""

from __future__ import annotations

from math import cos, inf, log1p, pi, sin, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, entry, inline, readable, row, scale

#: The true maximum is no larger than (1 + TOLERANCE) times the value returned.
TOLERANCE = 1e-3
_STACK = 4096
_FLOOR = 1e-3  # nearer to the wire than this the field is taken at this distance [m], as in DangerField


@inline
def _static(p: Vector, r0: Array, r1: Array) -> tuple[float, Vector, float]:
    """The static field (1) summed over links as in (3), (5), its gradient, and the distance of p from the wire."""
    value, gradient, nearest = 0.0, (0.0, 0.0, 0.0), inf
    for i in range(r0.shape[0]):
        a, b = row(r0, i), row(r1, i)
        d, w0, w1 = add(b, -1.0, a), add(p, -1.0, a), add(p, -1.0, b)
        dd = dot(d, d)
        l = min(max(dot(w0, d) / dd, 0.0), 1.0) if dd > 0.0 else 0.0
        foot = add(w0, -l, d)
        distance = sqrt(dot(foot, foot))
        nearest = min(nearest, distance)
        L = sqrt(dd)
        R0, R1 = max(sqrt(dot(w0, w0)), _FLOOR), max(sqrt(dot(w1, w1)), _FLOOR)
        sigma, ww = R0 + R1, dot(w0, w1)
        if 1e-6 * sigma > L:  # a link without length counts 1/R
            m = scale(0.5, add(w0, 1.0, w1))
            R = max(sqrt(dot(m, m)), _FLOOR)
            value += 1.0 / R
            gradient = add(gradient, -1.0 / R**3, m)
            continue
        # S = log1p(L (σ+L)/D)/L, ∇S = -(ŵ0 + ŵ1)/D, D = R0 R1 + w0·w1; without cancellation where w0·w1 < 0
        D = R0 * R1 + ww
        if ww < 0.0:
            h = max(distance, _FLOOR)
            D = dd * h * h / (R0 * R1 - ww)
        value += log1p(L * (sigma + L) / D) / L
        gradient = add(gradient, -1.0 / (D * R0), w0)
        gradient = add(gradient, -1.0 / (D * R1), w1)
    return value, gradient, max(nearest, _FLOOR)


@inline
def _patch(
    kind: int, s: float, t: float, hs: float, ht: float, a: Vector, e: Vector, x: Vector, y: Vector, L: float, r: float
) -> tuple[Vector, Vector, float]:
    """Centre, outward normal and radius of a patch: kind 0 the cylinder (place along it, angle), 1 to 12 cube faces."""
    if kind == 0:
        n = add(scale(cos(t), x), sin(t), y)
        reach = sqrt((hs * L) ** 2 + (2.0 * r * sin(0.5 * ht)) ** 2)
        return add(add(a, s * L, e), r, n), n, reach
    face = (kind - 1) % 6
    if face < 2:
        n = add(add(scale(1.0 if face == 0 else -1.0, e), s, x), t, y)
    elif face < 4:
        n = add(add(scale(1.0 if face == 2 else -1.0, x), s, y), t, e)
    else:
        n = add(add(scale(1.0 if face == 4 else -1.0, y), s, e), t, x)
    n = scale(1.0 / sqrt(dot(n, n)), n)
    centre = a if kind <= 6 else add(a, L, e)
    # projecting the cube onto the sphere inside it makes no distance longer
    return add(centre, r, n), n, r * sqrt(hs * hs + ht * ht)


@inline
def _bound(value: float, g: Vector, n: Vector, rho: float, D: float, r: float) -> float:
    """The largest value on a patch at most, see the module's text."""
    if not rho < D:
        return inf
    simple = value * D / (D - rho)
    normal = dot(g, n)
    tangent = add(g, -normal, n)
    bend = max(0.0, -normal) * rho * rho / (2.0 * r)
    fine = value + sqrt(dot(tangent, tangent)) * rho + bend + rho * rho * value * D / (D - rho) ** 3
    return min(simple, fine)


@entry(
    types.void(
        readable(3),
        readable(3),
        readable(4),
        readable(1),
        types.int64[:, ::1],
        types.float64,
        types.int64[::1],
        types.float64[:, ::1],
        types.float64[::1],
        types.float64[:, ::1],
    )
)
def _peaks(
    starts: Array,
    ends: Array,
    capsules: Array,
    radii: Array,
    order: NDArray[np.int64],
    tolerance: float,
    kinds: NDArray[np.int64],
    cells: Array,
    peak: Array,
    place: Array,
) -> None:
    """Fill peak and place; kinds and cells (s, t, half widths, bound) are the stack of patches to look at."""
    for k in range(starts.shape[0]):
        r0, r1 = starts[k], ends[k]
        best, where = -1.0, (0.0, 0.0, 0.0)
        for j in range(order.shape[1]):
            c = order[k, j]
            a, b, r = row(capsules[k, c], 0), row(capsules[k, c], 1), radii[c]
            e = add(b, -1.0, a)
            L = sqrt(dot(e, e))
            e = scale(1.0 / L, e) if L > 0.0 else (0.0, 0.0, 1.0)
            axis = (1.0, 0.0, 0.0) if abs(e[0]) < 0.6 else (0.0, 1.0, 0.0)
            x = cross(e, axis)
            x = scale(1.0 / sqrt(dot(x, x)), x)
            y = cross(e, x)
            top = 0
            for quarter in range(4):
                kinds[top] = 0
                cells[top, 0], cells[top, 1] = 0.5, (quarter + 0.5) * 0.5 * pi
                cells[top, 2], cells[top, 3], cells[top, 4] = 0.5, 0.25 * pi, inf
                top += 1
            for kind in range(1, 13):
                kinds[top] = kind
                cells[top, 0], cells[top, 1], cells[top, 2], cells[top, 3], cells[top, 4] = 0.0, 0.0, 1.0, 1.0, inf
                top += 1
            while top > 0:
                top -= 1
                kind, s, t, hs, ht = kinds[top], cells[top, 0], cells[top, 1], cells[top, 2], cells[top, 3]
                if cells[top, 4] <= best * (1.0 + tolerance):
                    continue
                p, n, rho = _patch(kind, s, t, hs, ht, a, e, x, y, L, r)
                value, g, D = _static(p, r0, r1)
                if value > best:
                    best, where = value, p
                bound = _bound(value, g, n, rho, D, r)
                if bound <= best * (1.0 + tolerance) or rho < 1e-5 or top + 2 > _STACK:
                    continue
                # halve the longer side of the patch
                long = hs * L > r * ht if kind == 0 else hs > ht
                for side in (-0.5, 0.5):
                    kinds[top] = kind
                    cells[top, 0] = s + side * hs if long else s
                    cells[top, 1] = t if long else t + side * ht
                    cells[top, 2] = 0.5 * hs if long else hs
                    cells[top, 3] = ht if long else 0.5 * ht
                    cells[top, 4] = bound
                    top += 1
        peak[k] = best
        place[k, 0], place[k, 1], place[k, 2] = where


def peak_field(
    starts: Array, ends: Array, capsules: Array, radii: Array, tolerance: float = TOLERANCE
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The largest static danger field on the surface of a person made of capsules, for each of several pairs.

    Args:
        starts: Starts of the links of the wire, world frame, (pairs, links, 3) [m].
        ends: Their ends, (pairs, links, 3) [m].
        capsules: Ends of the capsules' axes, (pairs, capsules, 2, 3) [m]; no capsule may touch the wire.
        radii: (capsules,) [m].
        tolerance: The true maximum is at most (1 + tolerance) times the one returned.

    Returns:
        The maxima (pairs,) [1/m] and where they are (pairs, 3) [m].
    """
    peak, place = np.empty(len(starts)), np.empty((len(starts), 3))
    # the capsules near the wire first: they leave less to look at in the others
    middles, wires = capsules.mean(axis=2), 0.5 * (starts + ends)
    far = np.linalg.norm(middles[:, :, None] - wires[:, None], axis=3).min(axis=2) - radii
    order = np.argsort(far, axis=1).astype(np.int64)
    kinds, cells = np.empty(_STACK, dtype=np.int64), np.empty((_STACK, 5))
    _peaks(starts, ends, capsules, radii, order, float(tolerance), kinds, cells, peak, place)
    return peak, place
