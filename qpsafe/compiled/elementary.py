"""Logarithm and angle without branches, for numbers and for lanes: within three units of the last place.

Polynomials in the place of the C library's functions, which do one number at a time. What they approximate is known as
a series; its shortest polynomial on the interval is found here, on import, by Chebyshev's interpolation. The leading
term is exact, so that what rounding does to the others' coefficients does not show.
"""

from __future__ import annotations

from decimal import Context, Decimal
from math import inf, nan, pi, sqrt
from typing import Any

import numpy as np

from qpsafe.compiled.compiled import inline
from qpsafe.compiled.lanes import copysign, split, where


def _shortest(sign: float, most: float, degree: int) -> tuple[float, ...]:
    """Coefficients of Σ sign^(k+1) z^k / (2k + 3), highest power first, shortened to a degree for 0 <= z <= most."""
    k = np.arange(80)

    def series(z: Any) -> Any:
        return (sign ** (k + 1) / (2 * k + 3) * np.asarray(z)[..., None] ** k).sum(axis=-1)

    found = np.polynomial.Chebyshev.interpolate(series, degree, (0.0, most)).convert(kind=np.polynomial.Polynomial)
    return tuple(float(c) for c in found.coef[::-1])


_HALF = sqrt(0.5)
# log m = 2 artanh s = 2 s + 2 s z Σ z^k/(2k + 3) with s = (m - 1)/(m + 1), z = s²; for sqrt(1/2) <= m <= sqrt(2)
_LOG = _shortest(1.0, (3.0 - 2.0 * sqrt(2.0)) ** 2, 7)
# atan t = t - t z Σ (-z)^k/(2k + 3) with z = t²; for t <= tan(π/8)
_EIGHTH = sqrt(2.0) - 1.0
_ATAN = _shortest(-1.0, _EIGHTH**2, 12)
_EXACT = Decimal(2).ln(Context(prec=40))
_LN2 = int(_EXACT * 2**40) / 2**40  # so few digits that e times it is exact
_LN2_REST = float(_EXACT - Decimal(_LN2))


@inline
def _polynomial(coefficients: tuple[float, ...], z: Any) -> Any:
    """Its value, by Horner's scheme."""
    value = z * coefficients[0] + coefficients[1]
    for k in range(2, len(coefficients)):
        value = value * z + coefficients[k]
    return value


@inline
def _log(x: Any, more: Any) -> Any:
    """log(x + more) for 0 < x < inf, with `more` below a unit of the last place of x."""
    small = x < 1e-300  # subnormal numbers have no leading one
    m, e, scale = split(where(small, x * 2.0**64, x))
    e = where(small, e - 64.0, e)
    upper = m > 2.0 * _HALF
    m, e, scale = where(upper, 0.5 * m, m), where(upper, e + 1.0, e), where(upper, 0.5 * scale, scale)
    s = (m - 1.0 + more * scale) / (m + 1.0)
    z = s * s
    return e * _LN2 + (2.0 * s + (2.0 * s * z * _polynomial(_LOG, z) + e * _LN2_REST))


@inline
def log(x: Any) -> Any:
    """Natural logarithm."""
    return where((x > 0.0) & (x < inf), _log(x, 0.0), where(x == 0.0, -inf, where(x > 0.0, inf, nan)))


@inline
def log1p(x: Any) -> Any:
    """log(1 + x) for x >= 0, exact for small x."""
    u = 1.0 + x
    value = where(u == 1.0, x, _log(u, x - (u - 1.0)))
    return where(x < inf, value, where(x > 0.0, inf, nan))


@inline
def atan2(y: Any, x: Any) -> Any:
    """Angle of a finite point of the plane [rad], 0 for the origin; subnormal numbers lose digits."""
    a, b = 0.5 * abs(x), 0.5 * abs(y)  # whose sum does not overflow
    steep = b > a
    high, low = where(steep, b, a), where(steep, a, b)
    beyond = low > _EIGHTH * high
    # tan of the angle, or of the angle less π/4
    t = where(beyond, low - high, low) / where(high == 0.0, 1.0, where(beyond, low + high, high))
    z = t * t
    tail = _polynomial(_ATAN, z)
    angle = t + t * z * tail
    angle = where(beyond, 0.25 * pi + angle, angle)
    angle = where(steep, 0.5 * pi - angle, angle)
    return copysign(where(x < 0.0, pi - angle, angle), y)
