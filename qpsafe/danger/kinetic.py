"""Compiled derivative of the kinetic danger field by the velocities of the links, in closed form.

With r_l = r0 + l d, w = p - r_l, R = |w|, v_l = v0 + l δ, v̂ = v_l/|v_l|, the field that motion adds is k2 H,

    H = Σ ∫ v_l·w/R³ + gamma |v_l|/R² dl,    ∂H/∂v0 = ∫ (1-l) (w/R³ + gamma v̂/R²) dl,    ∂H/∂v1 with l for (1-l).

The first term is that of `link_field`. For the second let z = λ + iμ be where R² = L² (l-z)(l-z̄) = 0; the integrals
E_k = ∫ l^k/(|v_l| |l-z|²) dl follow from I = ∫ dl/((l-z) |v_l|) and B = ∫ dl/|v_l|:

    E_0 = Im I/μ,    E_1 = Re I + λ E_0,    E_2 = B + 2 λ E_1 - |z|² E_0.

H is homogeneous in the velocities, so Σ ∂H/∂v·v = H (Euler); that is tested, and tells of every digit lost.
"""

from __future__ import annotations

from math import isfinite, log1p, nan, sqrt

from numba import types

from qpsafe.compiled.compiled import Array, Vector, add, dot, entry, inline, readable, row, scale
from qpsafe.danger import link_field
from qpsafe.danger.link_field import NODES, WEIGHTS, placed
from qpsafe.danger.speed import Motion, motion_of, pole_integral

_FAR = (
    1e-4  # of L/(R0+R1): below, nodes are exact to 1e-16; digits that the closed form loses grow as (R/L)², 1e-8 here
)


@inline
def _near(w0: Vector, w1: Vector, d: Vector, motion: Motion, gamma: float) -> tuple[Vector, Vector]:
    """∂H/∂v0 and ∂H/∂v1 of one link in closed form."""
    size, v0, _, delta, V0, V1, alpha, Dv, A = motion
    L, R0, R1 = sqrt(dot(d, d)), sqrt(dot(w0, w0)), sqrt(dot(w1, w1))
    u, sigma = scale(1.0 / L, d), R0 + R1
    t0, t1 = -dot(w0, u), -dot(w1, u)
    wn = add(w0, t0, u) if R0 < R1 else add(w1, t1, u)  # w⊥, from the nearer end
    hh, ww = dot(wn, wn), dot(w0, w1)
    D = R0 * R1 + ww if ww >= 0.0 else L * L * hh / (R0 * R1 - ww)
    # ∫ w/R³ = e/D, e = ŵ0 + ŵ1, and ∫ l w/R³ = w⊥/(R1 D) + u (1/R1 - S)/L, S = ∫ 1/R: see `link_field._near`
    e = add(scale(sigma / (R0 * R1), wn), -(t0 + t1) * D / (R0 * R1 * sigma), u)
    S = log1p(L * (sigma + L) / D) / L
    g1 = add(scale(1.0 / (R1 * D), wn), (1.0 / R1 - S) / L, u)
    g0 = add(scale(1.0 / D, e), -1.0, g1)
    if size > 0.0:
        lam, lam1, mu = -t0 / L, -t1 / L, max(sqrt(hh) / L, 1e-12)
        vl = add(v0, lam, delta)
        Ir, Ii, _, _ = pole_integral(lam, lam1, mu, (dot(vl, vl), dot(vl, delta), alpha), V0, V1, Dv)
        B = A / alpha if alpha > 1e-30 else 2.0  # V0 + V1 = 1
        E0 = Ii / mu
        E1 = Ir + lam * E0
        E2 = B + 2.0 * lam * E1 - (lam * lam + mu * mu) * E0
        share = gamma / (L * L)
        g0 = add(add(g0, share * (E0 - E1), v0), share * (E1 - E2), delta)
        g1 = add(add(g1, share * E1, v0), share * E2, delta)
    return g0, g1


@inline
def _far(w0: Vector, w1: Vector, d: Vector, motion: Motion, gamma: float) -> tuple[Vector, Vector]:
    """∂H/∂v0 and ∂H/∂v1 of one link that is a point beside its distance, by 8 nodes; both ends move nearly alike."""
    w, v = scale(0.5, add(w0, 1.0, w1)), scale(0.5, add(motion[1], 1.0, motion[2]))
    g0, g1 = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(8):
        wj, vj = add(w, -NODES[j], d), add(v, NODES[j], motion[3])
        q, size = 1.0 / dot(wj, wj), sqrt(dot(vj, vj))
        g = scale(q * sqrt(q), wj)
        if size > 0.0:
            g = add(g, gamma * q / size, vj)
        g0, g1 = add(g0, WEIGHTS[j] * (0.5 - NODES[j]), g), add(g1, WEIGHTS[j] * (0.5 + NODES[j]), g)
    return g0, g1


_rows = readable(2)


@entry(
    types.void(_rows, _rows, _rows, _rows, _rows, *[types.float64] * 3, types.Array(types.float64, 4, "C")),
    link_field,
    *link_field.USES,
)
def velocity_gradient(
    points: Array, r0: Array, r1: Array, v0: Array, v1: Array, kinetic: float, gamma: float, floor: float, out: Array
) -> None:
    """Fill out (p, links, 2, 3) with k2 ∂H/∂v of both ends of each link; NaN if any is not finite."""
    for i in range(r0.shape[0]):
        motion = motion_of(row(v0, i), row(v1, i))
        for j in range(points.shape[0]):
            d, w0, w1 = placed(row(points, j), row(r0, i), row(r1, i), motion, floor)
            if sqrt(dot(d, d)) < _FAR * (sqrt(dot(w0, w0)) + sqrt(dot(w1, w1))):
                g0, g1 = _far(w0, w1, d, motion, gamma)
            else:
                g0, g1 = _near(w0, w1, d, motion, gamma)
            good = isfinite(dot(g0, g0) + dot(g1, g1) + dot(w0, w0))
            for c in range(3):
                out[j, i, 0, c] = kinetic * g0[c] if good else nan
                out[j, i, 1, c] = kinetic * g1[c] if good else nan
