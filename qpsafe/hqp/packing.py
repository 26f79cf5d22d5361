"""A hierarchy copied into arrays, one level below the other: what the solvers work on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.hqp.level import Level, as_levels, named_level
from qpsafe.text.given import numbers, parts

Array = NDArray[np.float64]

_FLOAT = np.dtype(np.float64)


class Packed(NamedTuple):
    """A problem in arrays; the first level are the hard rows if `hard`.

    Attributes:
        A: (rows, n) rows of all levels.
        low: (rows,) their lower bounds.
        high: (rows,) their upper bounds.
        weight: (rows,) their weights, or None for equal ones.
        counts: rows of each level.
        box_low: (n,) lower limits, may be -inf.
        box_high: (n,) upper limits, may be +inf.
        hard: whether the first level are hard rows.
    """

    A: Array
    low: Array
    high: Array
    weight: Array | None
    counts: tuple[int, ...]
    box_low: Array
    box_high: Array
    hard: bool


def pack(
    levels: Iterable[Level | Sequence[Any]],
    lower: ArrayLike | None,
    upper: ArrayLike | None,
    rows: tuple[ArrayLike, ArrayLike, ArrayLike] | None,
) -> Packed:
    """Copy the problem into arrays: whole lists at once where all is plain, through `as_levels` where it is not.

    Args:
        levels: As for `solve_hierarchy`.
        lower: (n,) [rad/s], or None.
        upper: (n,) [rad/s], or None.
        rows: Hard rows (G, lower, upper), or None.
    """
    if type(levels) is not list:
        levels = list(parts("solve_hierarchy", "levels", levels, "a list of Levels and of pairs (A, b)"))
    hard = None if rows is None else _hard(rows)
    if not levels and hard is None:
        return _without_levels(lower, upper)
    plain, weight = False, None
    if levels and type(levels[0]) is not Level:  # pairs (A, b), perhaps
        matrices, lows, counts = ([], [], []) if hard is None else ([hard.A], [hard.lower], [hard.rows])
        try:
            for A, b in levels:  # type: ignore[misc]
                # concatenated, masks would be lost, and lists be what they happen to become
                if type(A) is not np.ndarray or type(b) is not np.ndarray or len(A) != len(b):
                    break
                matrices.append(A)
                lows.append(b)
                counts.append(len(A))
            else:  # nor are truth values numbers: "no" casting
                matrix = np.concatenate(matrices, dtype=_FLOAT, casting="no")
                low = high = np.concatenate(lows, dtype=_FLOAT, casting="no")
                if hard is not None:
                    high = np.concatenate([hard.upper, *lows[1:]])
                plain = matrix.ndim == 2 and low.ndim == 1
        except (TypeError, ValueError):  # Levels among them, rows given as vectors, or mistakes
            pass
    if not plain:
        matrix, low, high, weight, counts = _stack(as_levels(levels, hard))
    if not matrix.flags.c_contiguous:
        matrix = np.ascontiguousarray(matrix)
    n = matrix.shape[1]
    if n == 0:
        raise ConfigurationError("solve_hierarchy", "levels[0].A.shape", matrix.shape, "(rows, n) with n >= 1")
    box_low = np.full(n, -np.inf) if lower is None else _limit(lower, n, "lower")
    box_high = np.full(n, np.inf) if upper is None else _limit(upper, n, "upper")
    # what Packed(...) does, without its detour through Python
    return tuple.__new__(Packed, (matrix, low, high, weight, tuple(counts), box_low, box_high, rows is not None))


def _stack(levels: list[Level]) -> tuple[Array, Array, Array, Array | None, list[int]]:
    """Matrix, bounds, weights (None if nobody has any) and number of rows of a list of levels."""
    matrices, lows, highs, counts = [], [], [], []
    equal = plain = True
    for level in levels:
        matrices.append(level.A)
        lows.append(level.lower)
        highs.append(level.upper)
        counts.append(level.A.shape[0])
        equal = equal and level.lower is level.upper
        plain = plain and level.weight is None
    low = np.concatenate(lows)
    weight = None
    if not plain:
        weight = np.concatenate([np.ones(len(x.A)) if x.weight is None else x.weight for x in levels])
    matrix, high = np.concatenate(matrices), low if equal else np.concatenate(highs)
    # arrays whose shape was changed in place? compiled code trusts it
    if not len(matrix) == len(low) == len(high) == len(low if weight is None else weight):
        raise ConfigurationError("solve_hierarchy", "levels", levels, "levels as they were made")
    return matrix, low, high, weight, counts


def _hard(rows: Any) -> Level:
    """The hard rows as a level."""
    if not (isinstance(rows, tuple | list) and len(rows) == 3):
        raise ConfigurationError("solve_hierarchy", "rows", rows, "three of them, (G, lower, upper)")
    return named_level("rows", *rows)


def _without_levels(lower: ArrayLike | None, upper: ArrayLike | None) -> Packed:
    """A problem of limits alone."""
    if lower is None and upper is None:
        raise ConfigurationError("solve_hierarchy", "levels", [], "at least one level or one limit")
    key, given = ("upper", upper) if lower is None else ("lower", lower)
    expected = "numbers [rad/s], one a joint"
    n = len(numbers("solve_hierarchy", key, given, expected, 1))
    if n == 0:
        raise ConfigurationError("solve_hierarchy", key, given, expected)
    box_low = np.full(n, -np.inf) if lower is None else _limit(lower, n, "lower")
    box_high = np.full(n, np.inf) if upper is None else _limit(upper, n, "upper")
    return Packed(np.empty((0, n)), np.empty(0), np.empty(0), None, (), box_low, box_high, False)


def unpack(problem: Packed) -> list[Level]:
    """The levels of a packed problem, hard rows first."""
    levels, first = [], 0
    for count in problem.counts:
        part = slice(first, first + count)
        weight = None if problem.weight is None else problem.weight[part]
        levels.append(Level(problem.A[part], problem.low[part], problem.high[part], weight))
        first += count
    return levels


def _limit(values: ArrayLike, n: int, name: str) -> Array:
    """(n,) limit, copied."""
    if type(values) is np.ndarray and values.dtype == _FLOAT:
        limit = values.copy()
    else:
        limit = numbers("solve_hierarchy", name, values, f"{n} numbers [rad/s]")
    if limit.shape != (n,):
        raise ConfigurationError("solve_hierarchy", f"{name}.shape", limit.shape, f"({n},)")
    return limit
