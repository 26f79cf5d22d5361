"""Integrals over a link with the speed |v_l|, the root of a quadratic in l, compiled: see `link_field`."""

from __future__ import annotations

from math import pi

from qpsafe.compiled.compiled import Vector, add, cross, dot, inline, scale
from qpsafe.compiled.elementary import atan2, log, log1p
from qpsafe.compiled.lanes import anywhere, copysign, sqrt, where

Four = tuple[float, float, float, float]
# speed V0 + V1; by which these are divided: v0, v1, δ = v1 - v0, V0 = |v0|, V1 = |v1|; α = |δ|²; Dv; A
Motion = tuple[float, Vector, Vector, Vector, float, float, float, float, float]


@inline
def motion_of(v0: Vector, v1: Vector) -> Motion:
    """Return what depends on the velocities alone; K1 and K2 are homogeneous in them."""
    V0, V1 = sqrt(dot(v0, v0)), sqrt(dot(v1, v1))
    speed = V0 + V1
    share = 1.0 / where(speed > 0.0, speed, 1.0)
    v0, v1, V0, V1 = scale(share, v0), scale(share, v1), share * V0, share * V1
    delta, vv = add(v1, -1.0, v0), dot(v0, v1)
    # Dv = V0 V1 + v0·v1 without cancellation
    x, alpha = cross(v0, v1), dot(delta, delta)
    Dv = where(vv < 0.0, dot(x, x) / (V0 * V1 - vv), V0 * V1 + vv)
    # A = α ∫ dl/|v_l| = sqrt(α) log1p(sqrt(α) (V0 + V1 + sqrt(α))/Dv)
    A = sqrt(alpha) * log1p(sqrt(alpha) * (1.0 + sqrt(alpha)) / Dv)
    through = Dv < 1e-30  # the velocity passes through 0: log Dv, unbounded, drops out of A + F below; not in either
    if anywhere(through):
        A = where(through, sqrt(alpha) * log(sqrt(alpha) * (1.0 + sqrt(alpha))), A)
        Dv = where(through, 1.0, Dv)
    return speed, v0, v1, delta, V0, V1, alpha, Dv, A


@inline
def pole_integral(lam: float, lam1: float, mu: float, Q: Vector, V0: float, V1: float, Dv: float) -> Four:
    """Return I = ∫ dl/((l-z) |v_l|), real and imaginary part, and ζ²; arguments as for `speed_potential`."""
    c, b, alpha = Q
    zz, zz1 = lam * lam + mu * mu, lam1 * lam1 + mu * mu
    # ζ² = |vλ|² - μ²α + 2iμ vλ·δ = |v_l|² continued to l = z; ζ is the root on the side of X = V1 z + V0 (z-1)
    re, im = c - mu * mu * alpha, 2.0 * mu * b
    modulus = sqrt(re * re + im * im)
    major = sqrt(0.5 * (modulus + abs(re)))
    minor = where(major > 0.0, 0.5 * im / major, 0.0)
    zr, zi = where(re >= 0.0, major, abs(minor)), where(re >= 0.0, minor, copysign(major, im))
    Xr, Xi = V1 * lam + V0 * lam1, (V0 + V1) * mu
    other = Xr * zr + Xi * zi < 0.0
    zr, zi = where(other, -zr, zr), where(other, -zi, zi)
    Yr, Yi = Xr + zr, Xi + zi
    XX, YY = Xr * Xr + Xi * Xi, Yr * Yr + Yi * Yi
    # Ψ = Log f - Log g with f = 2 Dv (z-1)/Y, g = Y/z: one logarithm and one angle, on the sheet of the two logs
    fr, fi = lam1 * Yr + mu * Yi, mu * Yr - lam1 * Yi  # (z-1) Ȳ
    gr, gi = lam * Yr + mu * Yi, lam * Yi - mu * Yr  # Y z̄
    angle = atan2(fi * gr - fr * gi, fr * gr + fi * gi)
    angle = where((fi > 0.0) & (gi < 0.0) & (angle < 0.0), angle + 2.0 * pi, angle)
    angle = where((fi < 0.0) & (gi > 0.0) & (angle > 0.0), angle - 2.0 * pi, angle)
    size = 0.5 * log((4.0 * Dv * Dv) * (zz * zz1) / (YY * YY))
    # I = ∫ dl/((l-z) |v_l|) = Ψ/ζ = -2 artanh(ζ/X)/ζ
    r0 = 1.0 / modulus
    Ir, Ii = (size * zr + angle * zi) * r0, (angle * zr - size * zi) * r0
    # or, for small ζ/X, its series, I = -2/X (1 + (ζ/X)²/3)
    small = modulus < 1e-6 * XX
    if anywhere(small):
        xr, xi = Xr * (1.0 / XX), -Xi * (1.0 / XX)  # 1/X
        qr, qi = zr * xr - zi * xi, zr * xi + zi * xr  # ζ/X
        cr, ci = 1.0 + (qr * qr - qi * qi) * (1.0 / 3.0), 2.0 * qr * qi * (1.0 / 3.0)
        Ir, Ii = where(small, -2.0 * (xr * cr - xi * ci), Ir), where(small, -2.0 * (xr * ci + xi * cr), Ii)
    return Ir, Ii, re, im


@inline
def speed_potential(lam: float, lam1: float, mu: float, Q: Vector, V0: float, V1: float, Dv: float) -> Vector:
    """Return F = Im Φ/μ - A = Im(ζΨ)/μ with its derivatives ∂F/∂λ and (∂F/∂μ)/μ, where Φ(z) = ∫ |v_l|/(l - z) dl.

    z = λ + iμ, lam1 = λ - 1, Q = (|vλ|², vλ·δ, α) with vλ = v0 + λδ, α = |δ|². L² K2 = Im Φ/μ = F + A.
    """
    _, b, alpha = Q
    zz, zz1 = lam * lam + mu * mu, lam1 * lam1 + mu * mu
    Ir, Ii, re, im = pole_integral(lam, lam1, mu, Q, V0, V1, Dv)
    # ∂F/∂λ = Im Φ'/μ, ∂F/∂μ = (Re Φ' - A - F)/μ with Φ' - A = (vλ·δ + iμα) I + V1/(z-1) - V0/z
    share = 1.0 / (zz * zz1 * mu)
    n0, n1, m = V0 * (share * zz1 * mu), V1 * (share * zz * mu), share * zz * zz1
    F = (re * Ii + im * Ir) * m
    axial = b * Ii * m + alpha * Ir - n1 + n0
    radial = (b * Ir - mu * alpha * Ii + n1 * lam1 - n0 * lam - F) * m * m
    return F, axial, radial
