"""Compiled danger field of straight moving links: eqs. (1) to (5) of the paper in closed form, with the gradient.

A link is r_l = r0 + l d, v_l = v0 + l δ, l in [0, 1] (not arc length), with velocities relative to that of the point p.
Let w = p - r_l, R = |w|. With weights k1, k2, gamma, all 1 in the paper,

    CDF = sum over links of  k1 S + k2 (gamma K2 + K1),   S = ∫ 1/R dl,   K1 = ∫ v·w/R³ dl,   K2 = ∫ |v|/R² dl.

`_near` integrates in closed form. That loses digits of K2 far from the link, and fails for a link of length zero: there
`_far` takes a quadrature, exact to rounding. What depends on the speed |v_l| is in `speed`.
"""

from __future__ import annotations

from math import inf, isfinite, log1p, nan, sqrt

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, entry, inline, readable, row, scale
from qpsafe.danger import speed as speed_module
from qpsafe.danger.speed import Motion, motion_of, speed_potential

# `_far` is for L/(R0+R1) below this, where its error is < 1e-11; that of the closed form grows as (R/L)², 2e-11 here.
FAR = 0.05

# Gauss-Legendre rule on s in [-1/2, 1/2]; row j: coefficients 0 to 7 of Lagrange's polynomial of node j / weight j.
NODES, WEIGHTS = (0.5 * x for x in np.polynomial.legendre.leggauss(8))
LAGRANGE = np.linalg.inv(np.vander(NODES, increasing=True)).T / WEIGHTS[:, None]


@inline
def _near(w0: Vector, w1: Vector, d: Vector, motion: Motion, k: Vector) -> tuple[float, Vector]:
    """Value and gradient of one link in closed form; k = (k1, k2, gamma)."""
    speed, v0, v1, delta, V0, V1, alpha, Dv, A = motion
    k1, k2, gamma = k[0], k[1] * speed, k[2]
    L, R0, R1 = sqrt(dot(d, d)), sqrt(dot(w0, w0)), sqrt(dot(w1, w1))
    iL, i0, i1 = 1.0 / L, 1.0 / R0, 1.0 / R1
    u, sigma = scale(iL, d), R0 + R1
    t0, t1 = -dot(w0, u), -dot(w1, u)
    wn = add(w0, t0, u) if R0 < R1 else add(w1, t1, u)  # w⊥, from the nearer end
    hh, ww = dot(wn, wn), dot(w0, w1)
    # D = R0 R1 + w0·w1 and e = ŵ0 + ŵ1 = w⊥ σ/(R0 R1) - u (t0+t1) D/(R0 R1 σ), without cancellation
    D = R0 * R1 + ww if ww >= 0.0 else L * L * hh / (R0 * R1 - ww)
    iD, i01 = 1.0 / D, i0 * i1
    e = add(scale(sigma * i01, wn), -(t0 + t1) * D * i01 / sigma, u)
    # S = log1p(L (σ+L)/D)/L, ∇S = -e/D
    S = log1p(L * (sigma + L) * iD) * iL
    dS = scale(-iD, e)
    if k2 == 0.0:
        return k1 * S, scale(k1, dS)
    # rigid part of K1, with v1 less the stretching s u, s = δ·u: K1 = (v0·e + δ·w⊥/R1)/D
    s = dot(delta, u)
    n0, n1, v1r = scale(i0, w0), scale(i1, w1), add(v1, -s, u)
    K1 = (dot(v0, e) + dot(delta, wn) * i1) * iD
    # ∇K1 = [(v0 - (v0·ŵ0)ŵ0)/R0 + (v1 - (v1·ŵ1)ŵ1)/R1 - K1 σ e]/D
    dK1 = add(scale(i0, add(v0, -dot(v0, n0), n0)), i1, add(v1r, -dot(v1r, n1), n1))
    dK1 = scale(iD, add(dK1, -K1 * sigma, e))
    # stretching part (prismatic joints): s ∫ l (w·u)/R³ dl = s (1/R1 - S)/L
    K1 += s * (i1 - S) * iL
    dK1 = add(dK1, -s * iL, add(dS, i1 * i1, n1))

    # K2 = (A + F)/L²
    lam, lam1, mu = -t0 * iL, -t1 * iL, max(sqrt(hh) * iL, 1e-12)
    vl = add(v0, lam, delta)
    Q = (dot(vl, vl), dot(vl, delta), alpha)
    F, axial, radial = speed_potential(lam, lam1, mu, Q, V0, V1, Dv)
    K2 = (A + F) * iL * iL
    # by the axis, outside the link, digits of ∂F/∂μ cancel: extrapolate from μ' and 2μ' by its series in μ²
    off = 3e-3 * min(abs(lam), abs(lam1))
    if mu < off and lam * lam1 > 0.0:
        once = speed_potential(lam, lam1, off, Q, V0, V1, Dv)[2]
        twice = speed_potential(lam, lam1, 2.0 * off, Q, V0, V1, Dv)[2]
        radial = once + (once - twice) * (1.0 - (mu / off) ** 2) / 3.0
    # ∇K2 = [u ∂F/∂λ + (w⊥/h) ∂F/∂μ]/L³
    iL3 = iL * iL * iL
    dK2 = add(scale(axial * iL3, u), radial * iL3 * iL, wn)
    gradient = add(scale(k1, dS), k2, add(dK1, gamma, dK2))
    return k1 * S + k2 * (gamma * K2 + K1), gradient


@inline
def _far(w0: Vector, w1: Vector, d: Vector, motion: Motion, k: Vector) -> tuple[float, Vector]:
    """Value and gradient of one link that is short beside its distance, by 8 nodes; k = (k1, k2, gamma).

    Everything but |v_l| is smooth here. Where |v_l| is not, because the velocity passes near zero, its products with
    the powers of s = l - 1/2 are integrated exactly: product integration.
    """
    speed, v0, v1, delta, V0, V1, alpha, _, A = motion
    k1, k2, gamma = k[0], k[1] * speed, k[2]
    w, v = scale(0.5, add(w0, 1.0, w1)), scale(0.5, add(v0, 1.0, v1))
    c, b = dot(v, v), dot(v, delta)  # |v_l|² = αs² + 2bs + c
    rough = alpha > 0.25 * c
    M0 = M1 = M2 = M3 = M4 = M5 = M6 = M7 = 0.0
    if rough:
        # Mk = ∫ s^k |v_l| ds; from (s^(k-1) |v|³)' = |v| [(k+2) α s^k + (2k+1) b s^(k-1) + (k-1) c s^(k-2)]
        x = cross(v0, v1)
        M0 = (0.5 * alpha * (V0 + V1) + b * (V1 - V0) + dot(x, x) * A / alpha) / (2.0 * alpha)
        odd, even = V1**3 - V0**3, V1**3 + V0**3
        M1 = (odd - 3.0 * b * M0) / (3.0 * alpha)
        M2 = (even / 2.0 - 5.0 * b * M1 - c * M0) / (4.0 * alpha)
        M3 = (odd / 4.0 - 7.0 * b * M2 - 2.0 * c * M1) / (5.0 * alpha)
        M4 = (even / 8.0 - 9.0 * b * M3 - 3.0 * c * M2) / (6.0 * alpha)
        M5 = (odd / 16.0 - 11.0 * b * M4 - 4.0 * c * M3) / (7.0 * alpha)
        M6 = (even / 32.0 - 13.0 * b * M5 - 5.0 * c * M4) / (8.0 * alpha)
        M7 = (odd / 64.0 - 15.0 * b * M6 - 6.0 * c * M5) / (9.0 * alpha)
    value, gradient = 0.0, (0.0, 0.0, 0.0)
    for j in range(8):
        wj, vj, C = add(w, -NODES[j], d), add(v, NODES[j], delta), LAGRANGE[j]
        speed = sqrt(dot(vj, vj))
        if rough:
            speed = C[0] * M0 + C[1] * M1 + C[2] * M2 + C[3] * M3 + C[4] * M4 + C[5] * M5 + C[6] * M6 + C[7] * M7
        q = 1.0 / dot(wj, wj)
        static, along, swift = k1 * sqrt(q), k2 * dot(vj, wj) * q * sqrt(q), k2 * gamma * speed * q
        value += WEIGHTS[j] * (static + along + swift)
        # ∇(1/R) = -w/R³, ∇(v·w/R³) = v/R³ - 3 (v·w) w/R⁵, ∇(1/R²) = -2w/R⁴
        gradient = add(gradient, -WEIGHTS[j] * q * (static + 3.0 * along + 2.0 * swift), wj)
        gradient = add(gradient, WEIGHTS[j] * k2 * q * sqrt(q), vj)
    return value, gradient


@inline
def _point(w: Vector, motion: Motion, k: Vector) -> tuple[float, Vector]:
    """Value and gradient of a link of length zero that moves as one: the integrands themselves; k = (k1, k2, gamma)."""
    v, V, k2 = motion[1], motion[4], k[1] * motion[0]
    q = 1.0 / dot(w, w)
    r = sqrt(q)
    static, along, swift = k[0] * r, k2 * dot(v, w) * q * r, k2 * k[2] * V * q
    # ∇(1/R) = -w/R³, ∇(v·w/R³) = v/R³ - 3 (v·w) w/R⁵, ∇(1/R²) = -2w/R⁴
    return static + along + swift, add(scale(-q * (static + 3.0 * along + 2.0 * swift), w), k2 * q * r, v)


@inline
def _any_normal(d: Vector, v: Vector) -> Vector:
    """Return a vector normal to the link d: where it moves to, the worst side; if it does not, any normal."""
    dd = dot(d, d)
    normal = add(v, -dot(v, d) / dd, d) if dd > 0.0 else v
    if dot(normal, normal) > 1e-24 * dot(v, v):
        return normal
    x, y, z = abs(d[0]), abs(d[1]), abs(d[2])
    axis = (1.0, 0.0, 0.0) if x <= y and x <= z else ((0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0))
    return cross(d, axis) if dd > 0.0 else axis


@inline
def placed(p: Vector, r0: Vector, r1: Vector, motion: Motion, floor: float) -> tuple[Vector, Vector, Vector]:
    """The link d, and p as seen from both its ends; p at distance `floor` from the link if it is nearer than that."""
    d, w0, w1 = add(r1, -1.0, r0), add(p, -1.0, r0), add(p, -1.0, r1)
    dd = dot(d, d)
    l = min(max(dot(w0, d) / dd, 0.0), 1.0) if dd > 0.0 else 0.5
    n = add(w0, -l, d) if l < 1.0 else w1  # from the nearest point of the link to p
    nn = dot(n, n)
    if nn < floor * floor:
        if nn <= 1e-26 * dd or nn == 0.0:  # on the link but for rounding
            n = _any_normal(d, add(motion[1], l, motion[3]))
        elif 0.0 < l < 1.0 and dd > 0.0:
            n = add(n, -dot(n, d) / dd, d)
        n = scale(floor / sqrt(dot(n, n)), n)
        w0, w1 = add(n, l, d), add(n, l - 1.0, d)
    return d, w0, w1


@inline
def _link(p: Vector, r0: Vector, r1: Vector, motion: Motion, k: Vector, floor: float) -> tuple[float, Vector]:
    """Value and gradient of one link at p."""
    d, w0, w1 = placed(p, r0, r1, motion, floor)
    dd = dot(d, d)
    if dd < 1e-18 * dot(w0, w0) < inf and motion[6] < 1e-18:  # errors below 1e-18
        return _point(add(w0, -0.5, d), motion, k)
    if sqrt(dd) < FAR * (sqrt(dot(w0, w0)) + sqrt(dot(w1, w1))):
        return _far(w0, w1, d, motion, k)
    return _near(w0, w1, d, motion, k)


_ROWS, _WEIGHTS = readable(2), types.UniTuple(types.float64, 3)
_OUT, _OUTS = types.float64[::1], types.float64[:, ::1]


@entry(
    types.void(_ROWS, _ROWS, _ROWS, _ROWS, _ROWS, _ROWS, _WEIGHTS, types.float64, _OUT, _OUTS),
    speed_module,
)
def danger_field(
    points: Array,
    point_velocities: Array,
    r0: Array,
    r1: Array,
    v0: Array,
    v1: Array,
    k: Vector,
    floor: float,
    value: Array,
    gradient: Array,
) -> None:
    """Fill value (p,) and gradient (p, 3) of eq. (5), NaN if any is not finite; points without velocities rest."""
    moving = point_velocities.shape[0] > 0
    value[:], gradient[:] = 0.0, 0.0
    for i in range(r0.shape[0]):
        a, b, va, vb = row(r0, i), row(r1, i), row(v0, i), row(v1, i)
        own = motion_of(va, vb)
        for j in range(points.shape[0]):
            motion, vp = own, row(point_velocities, j) if moving else (0.0, 0.0, 0.0)
            if vp[0] != 0.0 or vp[1] != 0.0 or vp[2] != 0.0:  # true for NaN
                motion = motion_of(add(va, -1.0, vp), add(vb, -1.0, vp))
            c, g = _link(row(points, j), a, b, motion, k, floor)
            value[j] += c
            gradient[j, 0], gradient[j, 1], gradient[j, 2] = add(row(gradient, j), 1.0, g)
    for j in range(points.shape[0]):
        p, g = row(points, j), row(gradient, j)
        if not isfinite(value[j] + abs(g[0]) + abs(g[1]) + abs(g[2]) + 0.0 * (p[0] + p[1] + p[2])):
            value[j], gradient[j] = nan, nan
        elif value[j] < 0.0:
            value[j] = 0.0  # rounding: the field is never negative for gamma >= 1
