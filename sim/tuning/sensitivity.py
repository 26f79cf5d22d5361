"""Which coordinates matter for which objective: PED-ANOVA of all trials of a search."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

from qpsafe.sim.tuning.ask import study_of

if TYPE_CHECKING:
    from qpsafe.sim.tuning.space import Space
    from qpsafe.sim.tuning.trial import Trial

#: Trials that are compared with all others: the better quarter in an objective.
QUANTILE = 0.25
#: With fewer trials nothing is said.
LEAST = 16


def sensitivity(space: Space, trials: Sequence[Trial]) -> dict[str, dict[str, float]]:
    """Shares of the coordinates in each objective, harm and lost: each sums to 1; empty for too few trials.

    What is compared is how the better quarter of the trials is distributed along a coordinate, and how all are. It
    tells what the search has learned to avoid, among its trials, which are denser where it expected more.

    Args:
        space: The coordinates.
        trials: Of the search.
    """
    if len(trials) < LEAST:
        return {}
    from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances

    found = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study = study_of(space, trials)
        for k, name in enumerate(("harm", "lost")):
            found[name] = get_param_importances(
                study,
                evaluator=PedAnovaImportanceEvaluator(target_quantile=QUANTILE),
                target=lambda trial, k=k: trial.values[k],
            )
    return {name: {d.name: float(shares.get(d.name, 0.0)) for d in space.dimensions} for name, shares in found.items()}
