"""A generated family of hierarchies: what goes wrong in practice, each kind on purpose.

All data are multiples of 2^-10 (near-singular ones of 2^-30): exact in float64, and small numbers for the exact judge.
Dependent rows are exact integer combinations, so the ranks are exact too.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS = (
    "interior",
    "limits active",
    "first level infeasible",
    "rank deficient",
    "conflicting",
    "degenerate",
    "hard rows",
    "inequality level",
    "near singular",
)


class Hierarchy(NamedTuple):
    """One problem: box, hard rows or None, levels (A, low, high), highest priority first."""

    kind: str
    lower: Array
    upper: Array
    rows: tuple[Array, Array, Array] | None
    levels: list[tuple[Array, Array, Array]]


def grid(a: object, bits: int = 10) -> Array:
    """The nearest multiples of 2^-bits."""
    return np.round(np.asarray(a, dtype=np.float64) * 2.0**bits) / 2.0**bits


def one(rng: np.random.Generator, kind: str, n: int) -> Hierarchy:
    """A random problem of n joints."""
    J, L = grid(rng.standard_normal((3, n))), grid(rng.standard_normal((3, n)))
    lower, upper = grid(-rng.uniform(0.1, 1.0, n)), grid(rng.uniform(0.1, 1.0, n))
    scale = rng.choice([0.5, 1.0, 2.0])
    if kind == "interior":
        lower, upper = 64.0 * lower, 64.0 * upper
        scale = 0.2
    b_J, b_L, q0 = (grid(scale * rng.standard_normal(k)) for k in (3, 3, n))
    rows = None
    extra = []
    if kind == "first level infeasible":
        b_J = 8.0 * b_J
    elif kind == "rank deficient":
        J[2] = J[0] - 2.0 * J[1]
        if rng.random() < 0.5:
            L[rng.integers(3)] = 0.0
        if rng.random() < 0.5:
            L[0] = 2.0 * L[1]
    elif kind == "conflicting":
        L[0] = J[0] + J[1]
        if rng.random() < 0.5:
            L[1] = J[2]
    elif kind == "degenerate":  # a solution on several limits at once, met exactly; fixed joints, doubled rows
        point = np.where(rng.random(n) < 0.5, np.where(rng.random(n) < 0.5, lower, upper), grid(0.1 * lower))
        b_J, b_L, q0 = J @ point, L @ point, point.copy()
        J, b_J = np.vstack((J, J[:1])), np.append(b_J, b_J[0])
        if rng.random() < 0.5:
            lower[0] = upper[0] = point[0]
    elif kind == "hard rows":
        k = int(rng.integers(1, 4))
        G = grid(rng.standard_normal((k, n)))
        centre = G @ grid(rng.uniform(lower, upper))
        rows = (G, centre - grid(rng.uniform(0.0, 0.5, k)), centre + grid(rng.uniform(0.0, 0.5, k)))
    elif kind == "inequality level":
        k = int(rng.integers(1, 5))
        low = grid(rng.standard_normal(k))
        extra = [(grid(rng.standard_normal((k, n))), low, low + grid(rng.uniform(0.0, 1.0, k)))]
    elif kind == "near singular":
        J[2] = J[0] + J[1] + grid(2.0 ** -rng.integers(6, 19) * rng.standard_normal(n), 30)
    levels = [*extra, (J, b_J, b_J), (L, b_L, b_L), (np.eye(n), q0, q0)]
    return Hierarchy(kind, lower, upper, rows, levels)


def family(count: int, seed: int = 0, sizes: tuple[int, ...] = (6, 7)) -> Iterator[Hierarchy]:
    """`count` problems, all kinds and sizes in turn."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        yield one(rng, KINDS[i % len(KINDS)], int(rng.choice(sizes)))


def drift(ticks: int, seed: int = 0, n: int = 7) -> Iterator[Hierarchy]:
    """A sequence of nearly equal problems with active limits, as a controller meets them."""
    rng = np.random.default_rng(seed)
    base, swing = rng.standard_normal((2, 6, n))
    target, pull = rng.standard_normal((2, 6))
    q0, turn = rng.standard_normal((2, n))
    lower, upper = grid(-rng.uniform(0.3, 1.0, n)), grid(rng.uniform(0.3, 1.0, n))
    for k in range(ticks):
        c, s = np.cos(2e-3 * k), np.sin(3e-3 * k)
        A, b, q = grid(c * base + s * swing), grid(1.5 * (s * target + c * pull)), grid(c * q0 + s * turn)
        levels = [(A[:3], b[:3], b[:3]), (A[3:], b[3:], b[3:]), (np.eye(n), q, q)]
        yield Hierarchy("drift", lower, upper, None, levels)
