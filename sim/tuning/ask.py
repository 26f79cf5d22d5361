"""What to try next: Optuna's TPE for two objectives under constraints, as a pure function of what was tried.

A study is built anew for every batch from the trials so far, with a sampler seeded by the search's seed and the
batch's number. So a search that was interrupted asks for the same as one that was not, whoever plays the trials, and
there is nothing to be locked or shared: Optuna's storage is the search's own journal.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.extras import require
from qpsafe.sim.tuning.space import Point, Space

if TYPE_CHECKING:
    from qpsafe.sim.tuning.trial import Trial

#: Values of a batch, asked for together.
BATCH = 8
#: Standard deviations, from bound to bound, of the first batch around the present values; the next is uniform.
SPREAD = 0.12
#: Candidates of TPE, of which the best is taken.
CANDIDATES = 64
STARTUP = 2 * BATCH


def study_of(space: Space, trials: Sequence[Trial], sampler: Any = None) -> Any:
    """The trials as a study of Optuna, in memory.

    Args:
        space: Their coordinates.
        trials: In their order.
        sampler: Of the study.

    Raises:
        MissingExtraError: optuna is not installed.
    """
    require("tune", "a search for parameters", "optuna")
    import optuna
    from optuna.trial import create_trial

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    kinds = distributions(space)
    study = optuna.create_study(directions=["minimize", "minimize"], sampler=sampler)
    for trial in trials:
        values, kept = (trial.score.harm, trial.score.lost), trial.score.constraints
        point = {name: min(max(trial.point[name], kind.low), kind.high) for name, kind in kinds.items()}
        study.add_trial(create_trial(values=values, params=point, distributions=kinds, constraints=dict(kept)))
    return study


def distributions(space: Space) -> dict[str, Any]:
    """The coordinates as Optuna's distributions."""
    from optuna.distributions import FloatDistribution

    return {d.name: FloatDistribution(d.low, d.high, log=d.log) for d in space.dimensions}


def ask(space: Space, trials: Sequence[Trial], seed: int, batch: int, count: int = BATCH) -> list[Point]:
    """The points of a batch; the first batch is near the present values.

    Args:
        space: Where to look.
        trials: All of the batches before, in their order.
        seed: Of the search.
        batch: Number from 1; batch 0 is the present values.
        count: Points.
    """
    if batch == 1:
        rng = np.random.default_rng((seed, batch))
        return [space.near(rng, SPREAD) for _ in range(count)]
    require("tune", "a search for parameters", "optuna")
    from optuna.samplers import TPESampler

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is new in Optuna says so
        sampler = TPESampler(
            seed=int(np.random.default_rng((seed, batch)).integers(2**31)), multivariate=True, constant_liar=True,
            n_startup_trials=STARTUP, n_ei_candidates=CANDIDATES,
        )  # fmt: skip
        study, kinds = study_of(space, trials, sampler), distributions(space)
        return [dict(study.ask(kinds).params) for _ in range(count)]
