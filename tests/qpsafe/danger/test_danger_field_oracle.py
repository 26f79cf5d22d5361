"""The compiled closed form against eqs. (1) to (5), written straight from the paper and integrated with 30 digits.

The oracle shares nothing with the kernel: Gauss-Legendre with 24 nodes on pieces of l in [0, 1] that shrink by a factor
of 4 towards the two places where the integrand is sharp, the nearest point of the link and the slowest one.
"""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from amounts import first, some, thinned

from qpsafe.danger.field import DangerField
from qpsafe.danger.link_field import FAR
from qpsafe.robot.wire import Wire

VALUE_TOLERANCE, GRADIENT_TOLERANCE = 1e-10, 1e-8
X, Y, Z = np.eye(3)
O = np.zeros(3)


def gauss_legendre(n: int) -> list[tuple[mpmath.mpf, mpmath.mpf]]:
    rule = []
    for guess in np.polynomial.legendre.leggauss(n)[0]:
        x = mpmath.findroot(lambda t: mpmath.legendre(n, t), mpmath.mpf(guess))
        slope = n * (x * mpmath.legendre(n, x) - mpmath.legendre(n - 1, x)) / (x * x - 1)
        rule.append((x, 2 / ((1 - x * x) * slope**2)))
    return rule


with mpmath.workdps(30):
    RULE = gauss_legendre(24)


def dot(a: list, b: list) -> mpmath.mpf:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def pieces(sharp: list[tuple[mpmath.mpf, mpmath.mpf]], splits: int) -> list[mpmath.mpf]:
    """Ends of the pieces of [0, 1] for sharp places (where, half width), each piece split further."""
    ends = {mpmath.mpf(0), mpmath.mpf(1)}
    for where, width in sharp:
        ends.add(where)
        width = max(width, -where, where - 1)
        while 1e-25 < width < 8:
            ends |= {where - width, where + width}
            width *= 4
    ends = sorted(x for x in ends if 0 <= x <= 1)
    return [a + (b - a) * k / splits for a, b in pairwise(ends) for k in range(splits)] + [ends[-1]]


def oracle(p, r0, r1, v0, v1, static=1.0, kinetic=1.0, gamma=1.0, splits=1):
    """CDF and gradient of one link by quadrature of (5) and of its derivative."""
    with mpmath.workdps(30):
        p, r0, r1, v0, v1 = ([mpmath.mpf(float(x)) for x in a] for a in (p, r0, r1, v0, v1))
        d, dv = [b - a for a, b in zip(r0, r1, strict=True)], [b - a for a, b in zip(v0, v1, strict=True)]
        w0, sharp = [b - a for a, b in zip(r0, p, strict=True)], []
        for start, change in (([-w for w in w0], d), (v0, dv)):  # |start + l change| is smallest at:
            if dot(change, change) > 0:
                where = -dot(start, change) / dot(change, change)
                least = [a + where * b for a, b in zip(start, change, strict=True)]
                sharp.append((where, mpmath.sqrt(dot(least, least) / dot(change, change))))
        value, gradient = mpmath.mpf(0), [mpmath.mpf(0)] * 3
        ends = pieces(sharp, splits)
        for a, b in pairwise(ends):
            for x, weight in RULE:
                l, dl = (a + b + (b - a) * x) / 2, weight * (b - a) / 2
                w = [w0[i] - l * d[i] for i in range(3)]
                v = [v0[i] + l * dv[i] for i in range(3)]
                R, speed, vw = mpmath.sqrt(dot(w, w)), mpmath.sqrt(dot(v, v)), dot(v, w)
                # (1) 1/R; (2) |v| (gamma + cos)/R² with |v| cos = v·w/R
                value += dl * (static / R + kinetic * (gamma * speed + vw / R) / R**2)
                along_w = -static / R**3 - kinetic * (2 * gamma * speed / R**4 + 3 * vw / R**5)
                gradient = [g + dl * (along_w * w[i] + kinetic * v[i] / R**3) for i, g in enumerate(gradient)]
        return float(value), np.array([float(g) for g in gradient])


def errors(geometry, weights=(1.0, 1.0, 1.0)) -> tuple[float, float]:
    """Relative errors of value and gradient (as a vector)."""
    p, r0, r1, v0, v1 = (np.asarray(a, dtype=float) for a in geometry)
    value, gradient = DangerField(*weights, floor=1e-6).evaluate(p[None], Wire(r0[None], r1[None], v0[None], v1[None]))
    expected, slope = oracle(p, r0, r1, v0, v1, *weights)
    return abs(value[0] - expected) / expected, np.linalg.norm(gradient[0] - slope) / np.linalg.norm(slope)


def agrees(geometry, weights=(1.0, 1.0, 1.0)) -> None:
    value_error, gradient_error = errors(geometry, weights)
    assert value_error <= VALUE_TOLERANCE
    assert gradient_error <= GRADIENT_TOLERANCE


DEGENERATE = {  # p, r0, r1, v0, v1
    "on the axis, before the link": (-0.3 * X, O, X, Y, Y + Z),
    "on the axis, behind the link": (1.2 * X, O, X, X + Y, -0.2 * X + Z),
    "on a slanted axis": (-np.ones(3) / 7, O, np.ones(3), Y, Z),
    "0.1 mm before the link on its axis": (-1e-4 * X, O, X, Y, Y + Z),
    "a hair off the axis": (-0.3 * X + 1e-13 * Y, O, X, Y, Y + Z),
    "just inside the near-axis rule": (-X + 2.9e-3 * Y, O, X, Y, Y + Z),
    "just outside the near-axis rule": (-X + 3.1e-3 * Y, O, X, Y, Y + Z),
    "near the axis, moving away along it": (1.001 * X + 1e-6 * Z, O, X, -2 * X, -2 * X),
    "zero length": (0.3 * Y, O, O, X + Y, X + Y),
    "zero length with two velocities": (0.3 * Y + Z, X, X, X + Y, -Z),
    "zero length, opposite velocities": (0.3 * Y + Z, X, X, Y, -Y),
    "almost zero length": (0.3 * Y, O, 1e-9 * X, X + Y, Z),
    "short beside its distance": (5 * Y + Z, O, 1e-3 * X, X + Y, Z),
    "short, turning about its middle": (5 * Y + Z, O, 1e-3 * X, 1e-3 * Y, -1e-3 * Y),
    "short, turning about a point off its middle": (5 * Y + Z, O, 1e-3 * X, 1e-3 * Y, -2e-3 * Y),
    "just far": (Y, O, 1.99 * FAR * X, Y, -Y + 1e-3 * Z),
    "just near": (Y, O, 2.02 * FAR * X, Y, -Y + 1e-3 * Z),
    "at rest": (0.2 * Y + 0.3 * X, O, X, O, O),
    "rotation about the first end": (0.2 * Y + 0.3 * X, O, X, O, Y),
    "rotation about the second end": (0.2 * Y + 0.3 * X, O, X, Z, O),
    "rotation about the middle": (0.2 * Y + 0.3 * X, O, X, Z, -Z),
    "rotation about the middle, point abreast of it": (1e-3 * Y + 0.5 * X, O, X, Y, -Y),
    "opposite velocities of different size": (0.2 * Y + 0.3 * X, O, X, 2 * Z, -0.3 * Z),
    "almost opposite velocities": (0.2 * Y + 0.3 * X, O, X, Z, -Z + 1e-8 * Y),
    "parallel velocities": (0.2 * Y + 0.3 * X, O, X, Y, 3 * Y),
    "equal velocities": (0.2 * Y + 0.3 * X, O, X, Y - Z, Y - Z),
    "almost equal velocities": (0.2 * Y + 0.3 * X, O, X, Y - Z, Y - Z + 1e-9 * Y),
    "moving straight at the point": (0.2 * Y + 0.5 * X, O, X, Y, Y),
    "moving straight away": (0.2 * Y + 0.5 * X, O, X, -Y, -Y),
    "sliding along itself": (0.2 * Y + 0.3 * X, O, X, X, X),
    "stretching": (0.2 * Y + 0.3 * X, O, X, -X, 2 * X),
    "0.1 mm off a link of 1 m": (1e-4 * Y + 0.3 * X, O, X, Y, Z),
    "0.1 mm off a link of 10 m": (1e-4 * Y + 3 * X, O, 10 * X, Y, Z),
    "0.1 mm off an end": (-1e-4 * (X + Y), O, X, Y, Z),
    "10 m away": (10 * Z + X, O, X, Y, Z),
    "the complex speed vanishes at the point": (0.5 * X + 0.25 * Y, O, X, 0.25 * Y - 0.5 * Z, 0.25 * Y + 0.5 * Z),
    "and almost": (0.5 * X + 0.25 * Y, O, X, 0.25 * Y - 0.5 * Z, 0.25 * Y + 0.500001 * Z),
}


@pytest.mark.parametrize("name", thinned(2, DEGENERATE))
def test_closed_form_equals_quadrature_in_degenerate_geometry(name):
    agrees(DEGENERATE[name])


def random_geometry(rng: np.random.Generator):
    """Lengths and distances from 0.1 mm to 10 m, speeds from 1 mm/s to 3 m/s, in any direction or degenerate."""

    def direction() -> np.ndarray:
        x = rng.normal(size=3)
        return x / np.linalg.norm(x)

    def speed() -> float:
        return 10 ** rng.uniform(-3, 0.5)

    length, distance, u = 10 ** rng.uniform(-4, 1), 10 ** rng.uniform(-4, 1), direction()
    normal = np.cross(u, direction())
    normal /= np.linalg.norm(normal)
    r0 = 0.1 * rng.normal(size=3)
    r1 = r0 + length * u
    p = [
        r0 + rng.uniform(-1, 2) * length * u + distance * normal,
        r0 + distance * direction(),
        r1 + distance * (u + 10 ** rng.uniform(-17, 0) * normal),
    ][rng.integers(3)]
    v0 = direction() * speed()
    v1 = [
        direction() * speed(),
        v0 + np.cross(direction() * speed(), r1 - r0),
        -v0 * speed() + direction() * 10 ** rng.uniform(-12, -2),
        v0 + direction() * 10 ** rng.uniform(-12, -2),
        O,
    ][rng.integers(5)]
    return (p, r0, r1, v0, v1) if rng.integers(2) else (p, r1, r0, v1, v0)


def test_closed_form_equals_quadrature_in_random_geometry():
    rng = np.random.default_rng(1)
    for _ in range(some(8, of=60)):
        agrees(random_geometry(rng))


@pytest.mark.slow
@pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.5), (0.3, 2.0, 3.0)])
def test_closed_form_equals_quadrature_in_much_random_geometry(weights):
    rng = np.random.default_rng(2)
    for _ in range(500):
        agrees(random_geometry(rng), weights)


@pytest.mark.parametrize(
    "name", first(1, ["almost opposite velocities", "0.1 mm off a link of 10 m", "a hair off the axis"])
)
def test_the_oracle_has_converged(name):
    value, gradient = oracle(*DEGENERATE[name])
    finer, slope = oracle(*DEGENERATE[name], splits=2)
    assert value == pytest.approx(finer, rel=1e-14)
    assert np.linalg.norm(gradient - slope) <= 1e-13 * np.linalg.norm(slope)
