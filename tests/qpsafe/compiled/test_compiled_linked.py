"""A compiled function called by other compiled code at its address: the same results as from Python."""

import numpy as np
from numba import types

from qpsafe.compiled.compiled import entry, linked, readable

_out = types.float64[::1]


@entry(types.float64(types.float64, readable(1), types.boolean, types.int64, _out))
def inner(factor: float, vector: np.ndarray, negative: bool, first: int, out: np.ndarray) -> float:
    total = 0.0
    for i in range(first, vector.shape[0]):
        out[i] = (-factor if negative else factor) * vector[i]
        total += out[i]
    return total


_inner = linked(inner)


@entry(types.float64(types.float64, types.float64[:, ::1], types.boolean, types.int64, types.float64[:, ::1]))
def outer(factor: float, matrix: np.ndarray, negative: bool, first: int, out: np.ndarray) -> float:
    total = 0.0
    for row in range(matrix.shape[0]):
        total += _inner(factor, matrix[row, ::2], negative, first, out[row])
    return total


def test_a_linked_function_does_what_it_does_from_python() -> None:
    rng = np.random.default_rng(3)
    for negative in (False, True):
        matrix = rng.normal(size=(4, 9))
        linked_out, python_out = np.zeros((2, 4, 5))
        total = outer(1.5, matrix, negative, 2, linked_out)
        expected = sum(inner(1.5, row[::2], negative, 2, out) for row, out in zip(matrix, python_out, strict=True))
        assert np.array_equal(linked_out, python_out)
        assert total == expected
        assert np.array_equal(linked_out[:, 2:], (-1.5 if negative else 1.5) * matrix[:, 4::2])
