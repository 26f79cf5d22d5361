"""The rows that keep shapes apart in one tick, as a level of the hierarchy that knows what it is about."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from qpsafe.hqp.level import Level

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class ClearanceLevel(Level):
    """The rows of one tick, an inequality level.

    Args:
        A: (rows, n), C-contiguous.
        upper: (rows,) [m/s].
        gaps: As kept.
        pairs: Numbers of the two shapes that each row keeps apart (rows, 2).
        names: Of all shapes.

    Attributes:
        gaps: Distances along the rows (rows,) [m].
    """

    __slots__ = ("_names", "_pairs", "gaps")

    gaps: Array
    _names: tuple[str, ...]
    _pairs: Index

    firm = True

    def __init__(self, A: Array, upper: Array, gaps: Array, pairs: Index, names: tuple[str, ...]) -> None:
        # shapes are right: without the checks of `Level`, which take longer than the rows, as does its own setting
        put = object.__setattr__
        put(self, "A", A), put(self, "upper", upper), put(self, "weight", None)
        put(self, "lower", np.full(len(upper), -np.inf))
        put(self, "gaps", gaps), put(self, "_pairs", pairs), put(self, "_names", names)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the two shapes that each row keeps apart."""
        return tuple((self._names[i], self._names[j]) for i, j in self._pairs.tolist())

    def binding(self, qd: Array) -> tuple[tuple[str, str, float], ...]:
        """Pairs of which a row binds at q̇ (n,) [rad/s]: names, and the smallest distance of such a row [m]."""
        return self._nearest(~(self.A @ qd < self.upper - 1e-9))

    def nearer(self, distance: float) -> tuple[tuple[str, str, float], ...]:
        """Pairs that are nearer to each other than a distance [m], as `binding`."""
        return self._nearest(self.gaps < distance)

    def _nearest(self, chosen: NDArray[np.bool_]) -> tuple[tuple[str, str, float], ...]:
        found: dict[tuple[str, str], float] = {}
        for pair, gap, wanted in zip(self.pairs, self.gaps.tolist(), chosen.tolist(), strict=True):
            if wanted:
                found[pair] = min(gap, found.get(pair, math.inf))
        return tuple((*pair, gap) for pair, gap in found.items())
