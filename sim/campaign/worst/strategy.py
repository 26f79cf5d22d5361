"""CMA-ES of the package `cma`, quiet, and with random numbers of ours."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.extras import require


def strategy(start: NDArray[np.float64], step: float, rng: np.random.Generator, **options: Any) -> Any:
    """A strategy to be asked and told, which minimises.

    Args:
        start: Where it begins (d,).
        step: Its first standard deviation.
        rng: Of all its random numbers.
        options: More of cma's.

    Raises:
        MissingExtraError: cma is not installed.
    """
    require("campaign", "a search", "cma")
    import cma

    quiet = {"seed": np.nan, "randn": lambda *shape: rng.standard_normal(shape), "verbose": -9, "verb_log": 0}
    return cma.CMAEvolutionStrategy(start, step, quiet | options)
