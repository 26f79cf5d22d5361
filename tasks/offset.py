"""Poses off a reference, compiled: how far a pose is from it, and the reference moved by an offset.

An offset is a shift and a rotation vector θ in world axes: x = x_d + shift, R = exp(θ) R_d.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, Vector, add, cross, dot, entry, inline
from qpsafe.tasks import clik
from qpsafe.tasks.clik import rotation_vector

_SMALL = 1e-4  # [rad] below it the series are exact to the last digit


@inline
def _shares(t2: float) -> tuple[float, float, float]:
    """sin t / t, (1 - cos t) / t² and (t - sin t) / t³, by the angle's square."""
    if t2 < _SMALL * _SMALL:
        return 1.0 - t2 / 6.0, 0.5 - t2 / 24.0, 1.0 / 6.0 - t2 / 120.0
    t = sqrt(t2)
    s, half = sin(t) / t, sin(0.5 * t)
    return s, 2.0 * half * half / t2, (1.0 - s) / t2


@inline
def turned(v: Vector, x: Vector) -> Vector:
    """exp(v) x = x + sin t / t v × x + (1 - cos t) / t² v × (v × x), t = |v|."""
    s, c, _ = _shares(dot(v, v))
    w = cross(v, x)
    return add(add(x, s, w), c, cross(v, w))


@inline
def turning(v: Vector, rate: Vector) -> Vector:
    """Angular velocity, world axes, of exp(v(t)): v̇ + (1 - cos t) / t² v × v̇ + (t - sin t) / t³ v × (v × v̇)."""
    _, c, d = _shares(dot(v, v))
    w = cross(v, rate)
    return add(add(rate, c, w), d, cross(v, w))


@inline
def rate_of(v: Vector, omega: Vector) -> Vector:
    """The inverse of `turning`: v̇ = ω - v × ω / 2 + e v × (v × ω), e = (1 - t/2 cot(t/2)) / t²; t below 2 pi."""
    t2 = dot(v, v)
    if t2 < _SMALL * _SMALL:
        e = 1.0 / 12.0 + t2 / 720.0
    else:
        half = 0.5 * sqrt(t2)
        e = (1.0 - half * cos(half) / sin(half)) / t2
    w = cross(v, omega)
    return add(add(omega, -0.5, w), e, cross(v, w))


@inline
def _row(T: Array, a: int) -> Vector:
    return T[a, 0], T[a, 1], T[a, 2]


@inline
def rotation_between(value: Array, pose: Array) -> Vector:
    """log(R R_dᵀ) of two poses (4, 4)."""
    r0, r1, r2 = _row(value, 0), _row(value, 1), _row(value, 2)
    d0, d1, d2 = _row(pose, 0), _row(pose, 1), _row(pose, 2)
    return rotation_vector(
        (
            (dot(r0, d0), dot(r0, d1), dot(r0, d2)),
            (dot(r1, d0), dot(r1, d1), dot(r1, d2)),
            (dot(r2, d0), dot(r2, d1), dot(r2, d2)),
        )
    )


@inline
def offset_into(value: Array, pose: Array, offset: Array) -> None:
    """How far a pose (4, 4) is from a reference pose (4, 4): shift, then rotation vector (6,)."""
    for c in range(3):
        offset[c] = value[c, 3] - pose[c, 3]
    offset[3], offset[4], offset[5] = rotation_between(value, pose)


@inline
def displace_into(pose: Array, twist: Array, offset: Array, rate: Array, moved: Array, moving: Array) -> None:
    """A reference pose (4, 4) and twist (6,) moved by an offset (6,) that changes by `rate` (6,)."""
    v = offset[3], offset[4], offset[5]
    for c in range(4):
        # exp(θ) R_d, column by column; places move by the shift alone
        column = pose[0, c], pose[1, c], pose[2, c]
        column = turned(v, column) if c < 3 else add(column, 1.0, (offset[0], offset[1], offset[2]))
        moved[0, c], moved[1, c], moved[2, c] = column
        moved[3, c] = pose[3, c]
    for c in range(3):
        moving[c] = twist[c] + rate[c]
    # ω = exp(θ) ω_d + what θ̇ turns
    omega = turned(v, (twist[3], twist[4], twist[5]))
    moving[3], moving[4], moving[5] = add(omega, 1.0, turning(v, (rate[3], rate[4], rate[5])))


_out, _outs = types.float64[::1], types.float64[:, ::1]  # types as kernels have them: nothing is compiled twice


@entry(types.void(_outs, _outs, _out), clik)
def _offset(value: Array, pose: Array, offset: Array) -> None:
    offset_into(value, pose, offset)


@entry(types.void(_outs, _out, _out, _out, _outs, _out), clik)
def _displaced(pose: Array, twist: Array, offset: Array, rate: Array, moved: Array, moving: Array) -> None:
    displace_into(pose, twist, offset, rate, moved, moving)


def offset_of(value: Any, pose: Any) -> Array:
    """Offset (6,) [m, rad] of a pose (4, 4) from a reference pose (4, 4)."""
    offset = np.empty(6)
    _offset(np.array(value, dtype=float, order="C"), np.array(pose, dtype=float, order="C"), offset)
    return offset


def displaced(pose: Any, twist: Any, offset: Array, rate: Array) -> tuple[Array, Array]:
    """A reference pose and twist moved by an offset.

    Args:
        pose: (4, 4).
        twist: (6,).
        offset: (6,) [m, rad].
        rate: Of the offset (6,) [m/s, rad/s].
    """
    moved, moving = np.empty((4, 4)), np.empty(6)
    own = [np.array(given, dtype=float, order="C") for given in (pose, twist, offset, rate)]
    _displaced(*own, moved, moving)
    return moved, moving
