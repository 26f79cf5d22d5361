"""The danger field as a vector, eq. (6) of the paper."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, Vector, dot, entry, inline, readable, row, rows, scale


@inline
def vector_of(value: float, gradient: Array, j: int) -> Vector:
    """(6) at point j."""
    g = row(gradient, j)
    size = abs(g[0]) + abs(g[1]) + abs(g[2])
    if size != 0.0:  # true for NaN
        g = scale(1.0 / size, g)  # |g|² neither overflows nor vanishes
        g = scale(value / sqrt(dot(g, g)), g)
    return g


@entry(types.void(readable(1), readable(2), types.float64[:, ::1]))
def _vector_field(value: Array, gradient: Array, vector: Array) -> None:
    for j in range(gradient.shape[0]):
        vector[j, 0], vector[j, 1], vector[j, 2] = vector_of(value[j], gradient, j)


def danger_vectors(value: Array, gradient: Array) -> Array:
    """Vector field CDF ∇CDF/|∇CDF|, eq. (6), of what `DangerField.evaluate` returned; NaN where that is.

    Args:
        value: CDF, (p,).
        gradient: of CDF, (p, 3).

    Returns:
        Vectors (p, 3) as long as CDF that point from the obstacle to the robot; 0 where the gradient is exactly 0.

    Raises:
        ConfigurationError: an array has a wrong shape.
    """
    value = np.asarray(value, dtype=np.float64).reshape(-1)
    gradient = rows(gradient, "gradient", len(value))
    vectors = np.empty(gradient.shape)
    _vector_field(value, gradient, vectors)
    return vectors
