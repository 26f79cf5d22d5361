"""How sure a share of counted cases is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError


def clopper_pearson(
    successes: ArrayLike, trials: int, confidence: float = 0.95
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Exact two-sided confidence limits of a probability, given independent trials.

    They are the probabilities at which as many successes or more, or as many or fewer, have the probability
    (1 - confidence)/2; quantiles of beta distributions. Each holds for one point of a curve, not for all at once.

    Args:
        successes: How many of the trials, whole numbers from 0 to `trials`, any shape.
        trials: At least 1.
        confidence: Above 0 and below 1.

    Returns:
        Lower and upper limits, of the same shape.

    Raises:
        ConfigurationError: A value is out of range.
    """
    from scipy.stats import beta

    k = np.asarray(successes, dtype=float)
    if not (trials >= 1 and ((k >= 0) & (k <= trials)).all()):
        raise ConfigurationError("clopper_pearson", "successes", successes, f"0 to {trials} trials")
    if not 0.0 < confidence < 1.0:
        raise ConfigurationError("clopper_pearson", "confidence", confidence, "above 0 and below 1")
    tail = 0.5 * (1.0 - confidence)
    with np.errstate(invalid="ignore"):
        low = np.where(k == 0, 0.0, beta.ppf(tail, k, trials - k + 1))
        high = np.where(k == trials, 1.0, beta.ppf(1.0 - tail, k + 1, trials - k))
    return low, high
