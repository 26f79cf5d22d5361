"""One priority of a hierarchy: rows `lower <= A q̇ <= upper`, met as well as possible in the least-squares sense."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError


class Level:
    """Rows of one priority.

    The level asks for `lower <= A q̇ <= upper`. Where that is impossible, it minimises `Σ weight_i v_i²`, v_i being the
    distance of row i to its interval. An equality is a row with `lower == upper`; infinite bounds are allowed.

    Shapes are checked here and raise; values are data of the loop and are checked, and reported, by the solver.

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
            ConfigurationError: if the shapes do not fit together.
        """
        self.A = matrix = _matrix(A)
        rows = matrix.shape[0]
        self.lower = _column(lower, rows, "lower")
        self.upper = self.lower if upper is lower else _column(upper, rows, "upper")
        self.weight = None if weight is None else _column(weight, rows, "weight")

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


def as_levels(levels: Iterable[Level | Sequence[Any]]) -> list[Level]:
    """Turn `[(A, b), ...]` and `[Level, ...]`, mixed as wished, into a list of levels.

    Raises:
        ConfigurationError: for anything else, and when the levels differ in the number of columns.
    """
    result: list[Level] = []
    for k, item in enumerate(levels):
        if type(item) is Level or isinstance(item, Level):
            level = item
        elif isinstance(item, (tuple, list)) and len(item) == 2:
            level = Level(item[0], item[1], item[1])
        else:
            raise ConfigurationError("solve_hierarchy", f"levels[{k}]", item, "a Level or a pair (A, b)")
        if result and level.A.shape[1] != result[0].A.shape[1]:
            columns = result[0].A.shape[1]
            raise ConfigurationError("solve_hierarchy", f"levels[{k}].A.shape", level.A.shape, f"(rows, {columns})")
        result.append(level)
    return result


def _matrix(A: ArrayLike) -> NDArray[np.float64]:
    try:
        matrix = np.ascontiguousarray(A, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigurationError("Level", "A", A, "a matrix of numbers") from None
    if np.ndim(A) == 1:
        matrix = matrix.reshape(1, -1)
    if matrix.ndim != 2 or np.ndim(A) == 0:
        raise ConfigurationError("Level", "A.shape", np.shape(A), "(rows, n)")
    return matrix


def _column(values: ArrayLike, rows: int, name: str) -> NDArray[np.float64]:
    try:
        column = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigurationError("Level", name, values, f"{rows} numbers, one a row of A") from None
    if column.ndim == 0:
        return np.full(rows, column)
    if column.shape != (rows,):
        raise ConfigurationError("Level", f"{name}.shape", column.shape, f"({rows},), one number a row of A")
    return np.ascontiguousarray(column)
