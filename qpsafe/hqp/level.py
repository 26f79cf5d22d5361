"""One priority of a hierarchy: rows `lower <= A q̇ <= upper`, met as well as possible in the least-squares sense."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.text.given import numbers

_FLOAT = np.dtype(np.float64)


class Level:
    """Rows of one priority.

    The level asks for `lower <= A q̇ <= upper`. Where that is impossible, it minimises `Σ weight_i v_i²`, v_i being the
    distance of row i to its interval. An equality is a row with `lower == upper`; infinite bounds are allowed.

    Shapes and kinds are checked here and raise; values are data of the loop and are checked, and reported, by the
    solver. Compiled code trusts the shapes, so the attributes are set once. Arrays of float64 are kept, not copied.

    Attributes:
        A: (rows, n) float64, C-contiguous.
        lower: (rows,) smallest value wanted, may be -inf.
        upper: (rows,) largest value wanted, may be +inf.
        weight: (rows,) positive weights of the squared violations, or None for equal weights.
    """

    __slots__ = ("A", "lower", "upper", "weight")

    #: Whether tasks of a controller below do not ask for what its upper bounds forbid, see `qpsafe.laws.yielding`.
    firm = False

    A: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    weight: NDArray[np.float64] | None

    def __init__(self, A: ArrayLike, lower: ArrayLike, upper: ArrayLike, weight: ArrayLike | None = None) -> None:
        """Store the rows.

        Args:
            A: (rows, n) matrix; a vector (n,) is one row.
            lower: (rows,) or a number for all rows.
            upper: (rows,) or a number for all rows.
            weight: positive number or (rows,) positive; None means 1.

        Raises:
            ConfigurationError: if the shapes do not fit together, or for anything but real numbers.
        """
        matrix = _matrix(A)
        rows = matrix.shape[0]
        low = _column(lower, rows, "lower")
        high = low if upper is lower else _column(upper, rows, "upper")
        weights = None if weight is None else _column(weight, rows, "weight")
        put = object.__setattr__  # ours would take longer than all the rest
        put(self, "A", matrix), put(self, "lower", low), put(self, "upper", high), put(self, "weight", weights)

    def __setattr__(self, key: str, value: Any) -> None:
        if key in Level.__slots__ and hasattr(self, key):
            raise ConfigurationError(type(self).__name__, key, value, "no change: make another Level instead")
        object.__setattr__(self, key, value)

    def __delattr__(self, key: str) -> None:
        if key in Level.__slots__:
            raise ConfigurationError(type(self).__name__, key, "deleted", "no change: make another Level instead")
        object.__delattr__(self, key)

    @classmethod
    def equality(cls, A: ArrayLike, b: ArrayLike, weight: ArrayLike | None = None) -> Level:
        """The level `A q̇ = b`.

        Args:
            A: (rows, n).
            b: (rows,).
            weight: positive number or (rows,) positive; None means 1.
        """
        return cls(A, b, b, weight)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.A.shape[0]

    @property
    def is_equality(self) -> bool:
        """Whether every row is an equality."""
        return self.lower is self.upper or bool(np.all(self.lower == self.upper))

    def violations(self, qd: NDArray[np.float64]) -> NDArray[np.float64]:
        """(rows,) signed distance of each row to its interval: negative below `lower`, positive above `upper`."""
        value = self.A @ qd
        return np.maximum(value - self.upper, 0.0) + np.minimum(value - self.lower, 0.0)

    def __repr__(self) -> str:
        kind = "equality" if self.is_equality else "inequality"
        return f"Level({self.A.shape[0]} x {self.A.shape[1]} {kind}{'' if self.weight is None else ', weighted'})"


def as_levels(levels: Iterable[Level | Sequence[Any]], hard: Level | None = None) -> list[Level]:
    """Turn `[(A, b), ...]` and `[Level, ...]`, mixed as wished, into a list of levels.

    Args:
        levels: As given.
        hard: A level that stands before them and does not count.

    Raises:
        ConfigurationError: for anything else, and when the levels differ in the number of columns.
    """
    result: list[Level] = [] if hard is None else [hard]
    for k, item in enumerate(levels):
        if type(item) is Level or isinstance(item, Level):
            level = item
        elif isinstance(item, (tuple, list)) and len(item) == 2:
            level = named_level(f"levels[{k}]", item[0], item[1], item[1])
        else:
            raise ConfigurationError("solve_hierarchy", f"levels[{k}]", item, "a Level or a pair (A, b)")
        if result and level.A.shape[1] != result[0].A.shape[1]:
            columns = result[0].A.shape[1]
            raise ConfigurationError("solve_hierarchy", f"levels[{k}].A.shape", level.A.shape, f"(rows, {columns})")
        result.append(level)
    return result


def named_level(name: str, A: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> Level:
    """A level of what was given to `solve_hierarchy`, whose errors say where.

    Args:
        name: Of the argument.
        A: (rows, n).
        lower: (rows,) or a number; the same object as `upper` for an equality, which is called b.
        upper: Likewise.
    """
    try:
        return Level(A, lower, upper)
    except ConfigurationError as error:
        key = error.key.replace("lower", "b") if lower is upper else error.key
        raise ConfigurationError("solve_hierarchy", f"{name}.{key}", error.value, error.expected) from None


def _matrix(A: ArrayLike) -> NDArray[np.float64]:
    """(rows, n), C-contiguous; the given array if it may be, else one of its own, which is read-only."""
    if type(A) is np.ndarray and A.dtype == _FLOAT and A.ndim == 2:
        return np.ascontiguousarray(A)
    matrix = numbers("Level", "A", A, "a matrix of real numbers")
    if matrix.ndim == 1:
        matrix = matrix.reshape(1, -1)
    if matrix.ndim != 2:
        raise ConfigurationError("Level", "A.shape", matrix.shape, "(rows, n)")
    matrix = np.ascontiguousarray(matrix)
    matrix.flags.writeable = False
    return matrix


def _column(values: ArrayLike, rows: int, name: str) -> NDArray[np.float64]:
    """(rows,), likewise; a number for all of them."""
    if type(values) is np.ndarray and values.dtype == _FLOAT and values.shape == (rows,):
        return np.ascontiguousarray(values)
    if type(values) is float:
        column = np.full(rows, values)
    else:
        column = numbers("Level", name, values, f"{rows} real numbers, one a row of A")
        column = column if column.ndim else np.full(rows, column)
    if column.shape != (rows,):
        raise ConfigurationError("Level", f"{name}.shape", column.shape, f"({rows},), one number a row of A")
    column.flags.writeable = False
    return column
