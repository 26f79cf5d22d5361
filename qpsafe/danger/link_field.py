"""Compiled danger field of straight moving links: eqs. (1) to (5) of the paper in closed form, with the gradient.

A link is r_l = r0 + l d, v_l = v0 + l δ, l in [0, 1] (not arc length), with velocities relative to that of the point p.
Let w = p - r_l, R = |w|. With weights k1, k2, gamma, all 1 in the paper,

    CDF = sum over links of  k1 S + k2 (gamma K2 + K1),   S = ∫ 1/R dl,   K1 = ∫ v·w/R³ dl,   K2 = ∫ |v|/R² dl.

`_near` integrates in closed form. That loses digits of K2 far from the link, and fails for a link of length zero: there
`_far` takes a quadrature, exact to rounding. What depends on the speed |v_l| is in `speed`.
"""

from __future__ import annotations

from math import inf, isfinite, nan

import numpy as np
from numba import types

from qpsafe.compiled import elementary, lanes
from qpsafe.compiled import gather as gather_module
from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, entry, inline, readable, row, scale
from qpsafe.compiled.elementary import log1p
from qpsafe.compiled.gather import gather, lane, spread
from qpsafe.compiled.lanes import LANES, anywhere, not_, sqrt, where
from qpsafe.danger import speed as speed_module
from qpsafe.danger.speed import Motion, motion_of, speed_potential

# `_far` is for L/(R0+R1) below this, where its error is < 1e-11; that of the closed form grows as (R/L)², 2e-11 here.
FAR = 0.05

# Gauss-Legendre rule on s in [-1/2, 1/2]; row j: coefficients 0 to 7 of Lagrange's polynomial of node j / weight j.
NODES, WEIGHTS = (0.5 * x for x in np.polynomial.legendre.leggauss(8))
LAGRANGE = np.linalg.inv(np.vander(NODES, increasing=True)).T / WEIGHTS[:, None]


@inline
def choose(condition: bool, yes: Vector, no: Vector) -> Vector:
    """`where` of vectors."""
    return where(condition, yes[0], no[0]), where(condition, yes[1], no[1]), where(condition, yes[2], no[2])


@inline
def _near(w0: Vector, w1: Vector, d: Vector, motion: Motion, k: Vector) -> tuple[float, Vector]:
    """Value and gradient of one link in closed form; k = (k1, k2, gamma)."""
    speed, v0, v1, delta, V0, V1, alpha, Dv, A = motion
    k1, k2, gamma = k[0], k[1] * speed, k[2]
    L, R0, R1 = sqrt(dot(d, d)), sqrt(dot(w0, w0)), sqrt(dot(w1, w1))
    iL, i0, i1 = 1.0 / L, 1.0 / R0, 1.0 / R1
    u, sigma = scale(iL, d), R0 + R1
    t0, t1 = -dot(w0, u), -dot(w1, u)
    wn = choose(R0 < R1, add(w0, t0, u), add(w1, t1, u))  # w⊥, from the nearer end
    hh, ww = dot(wn, wn), dot(w0, w1)
    # D = R0 R1 + w0·w1 and e = ŵ0 + ŵ1 = w⊥ σ/(R0 R1) - u (t0+t1) D/(R0 R1 σ), without cancellation
    over, under = where(ww >= 0.0, R0 * R1 + ww, L * L * hh), where(ww >= 0.0, 1.0, R0 * R1 - ww)  # D = over/under
    iD, i01 = under / over, i0 * i1
    e = add(scale(sigma * i01, wn), -(t0 + t1) * over * i01 / (sigma * under), u)
    # S = log1p(L (σ+L)/D)/L, ∇S = -e/D
    S = log1p(L * (sigma + L) * iD) * iL
    dS = scale(-iD, e)
    moves = k2 != 0.0  # true for NaN
    if not anywhere(moves):
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
    lam, lam1, mu = -t0 * iL, -t1 * iL, sqrt(hh) * iL
    mu = where(mu > 1e-12, mu, 1e-12)
    vl = add(v0, lam, delta)
    Q = (dot(vl, vl), dot(vl, delta), alpha)
    F, axial, radial = speed_potential(lam, lam1, mu, Q, V0, V1, Dv)
    K2 = (A + F) * iL * iL
    # by the axis, outside the link, digits of ∂F/∂μ cancel: extrapolate from μ' and 2μ' by its series in μ²
    off = 3e-3 * where(abs(lam) < abs(lam1), abs(lam), abs(lam1))
    by_axis = (mu < off) & (lam * lam1 > 0.0)
    if anywhere(by_axis):
        once = speed_potential(lam, lam1, off, Q, V0, V1, Dv)[2]
        twice = speed_potential(lam, lam1, 2.0 * off, Q, V0, V1, Dv)[2]
        share = mu / off
        radial = where(by_axis, once + (once - twice) * (1.0 - share * share) / 3.0, radial)
    # ∇K2 = [u ∂F/∂λ + (w⊥/h) ∂F/∂μ]/L³
    iL3 = iL * iL * iL
    dK2 = add(scale(axial * iL3, u), radial * iL3 * iL, wn)
    gradient = add(scale(k1, dS), k2, add(dK1, gamma, dK2))
    # at rest there are no digits in K1 and K2
    return where(moves, k1 * S + k2 * (gamma * K2 + K1), k1 * S), choose(moves, gradient, scale(k1, dS))


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
    M0 = M1 = M2 = M3 = M4 = M5 = M6 = M7 = 0.0 * c
    if anywhere(rough):
        # Mk = ∫ s^k |v_l| ds; from (s^(k-1) |v|³)' = |v| [(k+2) α s^k + (2k+1) b s^(k-1) + (k-1) c s^(k-2)]
        x = cross(v0, v1)
        M0 = (0.5 * alpha * (V0 + V1) + b * (V1 - V0) + dot(x, x) * A / alpha) / (2.0 * alpha)
        odd, even = V1 * V1 * V1 - V0 * V0 * V0, V1 * V1 * V1 + V0 * V0 * V0
        M1 = (odd - 3.0 * b * M0) / (3.0 * alpha)
        M2 = (even / 2.0 - 5.0 * b * M1 - c * M0) / (4.0 * alpha)
        M3 = (odd / 4.0 - 7.0 * b * M2 - 2.0 * c * M1) / (5.0 * alpha)
        M4 = (even / 8.0 - 9.0 * b * M3 - 3.0 * c * M2) / (6.0 * alpha)
        M5 = (odd / 16.0 - 11.0 * b * M4 - 4.0 * c * M3) / (7.0 * alpha)
        M6 = (even / 32.0 - 13.0 * b * M5 - 5.0 * c * M4) / (8.0 * alpha)
        M7 = (odd / 64.0 - 15.0 * b * M6 - 6.0 * c * M5) / (9.0 * alpha)
    value, gradient = 0.0 * c, scale(0.0 * c, v)
    for j in range(8):
        wj, vj, C = add(w, -NODES[j], d), add(v, NODES[j], delta), LAGRANGE[j]
        product = C[0] * M0 + C[1] * M1 + C[2] * M2 + C[3] * M3 + C[4] * M4 + C[5] * M5 + C[6] * M6 + C[7] * M7
        speed = where(rough, product, sqrt(dot(vj, vj)))
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
    long = dd > 0.0
    normal = choose(long, add(v, -dot(v, d) / dd, d), v)
    x, y, z = abs(d[0]), abs(d[1]), abs(d[2])
    along_x = (x <= y) & (x <= z)
    along_y = where(along_x, 0.0, where(y <= z, 1.0, 0.0))
    axis = where(along_x, 1.0, 0.0), along_y, where(along_x, 0.0, 1.0 - along_y)
    found = dot(normal, normal) > 1e-24 * dot(v, v)
    return choose(found, normal, choose(long, cross(d, axis), axis))


@inline
def placed(p: Vector, r0: Vector, r1: Vector, motion: Motion, floor: float) -> tuple[Vector, Vector, Vector]:
    """The link d, and p as seen from both its ends; p at distance `floor` from the link if it is nearer than that."""
    d, w0, w1 = add(r1, -1.0, r0), add(p, -1.0, r0), add(p, -1.0, r1)
    dd = dot(d, d)
    l = where(dd > 0.0, dot(w0, d) / dd, 0.5)
    l = where(l > 0.0, where(l < 1.0, l, 1.0), 0.0)
    n = choose(l < 1.0, add(w0, -l, d), w1)  # from the nearest point of the link to p
    nn = dot(n, n)
    near = nn < floor * floor
    if anywhere(near):
        on = (nn <= 1e-26 * dd) | (nn == 0.0)  # on the link but for rounding
        beside = (l > 0.0) & (l < 1.0) & (dd > 0.0)
        n = choose(beside, add(n, -dot(n, d) / dd, d), n)
        n = choose(on, _any_normal(d, add(motion[1], l, motion[3])), n)
        n = scale(floor / sqrt(dot(n, n)), n)
        w0, w1 = choose(near, add(n, l, d), w0), choose(near, add(n, l - 1.0, d), w1)
    return d, w0, w1


@inline
def _link(p: Vector, r0: Vector, r1: Vector, motion: Motion, k: Vector, floor: float) -> tuple[float, Vector]:
    """Value and gradient of one link at p."""
    d, w0, w1 = placed(p, r0, r1, motion, floor)
    dd, ww = dot(d, d), dot(w0, w0)
    short = sqrt(dd) < FAR * (sqrt(ww) + sqrt(dot(w1, w1)))
    still = (dd < 1e-18 * ww) & (ww < inf) & (motion[6] < 1e-18)  # errors below 1e-18
    value, gradient = 0.0 * ww, scale(0.0, w0)
    if anywhere(not_(short)):
        value, gradient = _near(w0, w1, d, motion, k)
    if anywhere(short & not_(still)):
        c, g = _far(w0, w1, d, motion, k)
        value, gradient = where(short, c, value), choose(short, g, gradient)
    if anywhere(still):
        c, g = _point(add(w0, -0.5, d), motion, k)
        value, gradient = where(still, c, value), choose(still, g, gradient)
    return value, gradient


#: All the code that goes into the kernel.
USES = (speed_module, elementary, lanes, gather_module)
_ROWS, _WEIGHTS = readable(2), types.UniTuple(types.float64, 3)
_OUT, _OUTS = types.float64[::1], types.float64[:, ::1]


@entry(
    types.void(_ROWS, _ROWS, _ROWS, _ROWS, _ROWS, _ROWS, _WEIGHTS, types.float64, _OUT, _OUTS),
    *USES,
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
    moving, count = point_velocities.shape[0] > 0, points.shape[0]
    for first in range(0, count, LANES):
        p = gather(points, first, 0), gather(points, first, 1), gather(points, first, 2)
        nothing = spread(0.0)
        vp = nothing, nothing, nothing
        if moving:
            vp = (gather(point_velocities, first, 0), gather(point_velocities, first, 1),
                  gather(point_velocities, first, 2))  # fmt: skip
        c, g = nothing, (nothing, nothing, nothing)
        for i in range(r0.shape[0]):
            motion = motion_of(add(row(v0, i), -1.0, vp), add(row(v1, i), -1.0, vp))
            one, slope = _link(p, row(r0, i), row(r1, i), motion, k, floor)
            c, g = c + one, add(g, 1.0, slope)
        for j in range(min(LANES, count - first)):
            value[first + j] = lane(c, j)
            gradient[first + j, 0], gradient[first + j, 1], gradient[first + j, 2] = (
                lane(g[0], j), lane(g[1], j), lane(g[2], j),
            )  # fmt: skip
    for j in range(points.shape[0]):
        p, g = row(points, j), row(gradient, j)
        if not isfinite(value[j] + abs(g[0]) + abs(g[1]) + abs(g[2]) + 0.0 * (p[0] + p[1] + p[2])):
            value[j], gradient[j] = nan, nan
        elif value[j] < 0.0:
            value[j] = 0.0  # rounding: the field is never negative for gamma >= 1
