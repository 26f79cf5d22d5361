"""Many days of the third experiment, several at a time."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from dataclasses import replace

from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.experiments.pick_place.report import PickFigures, figures


def run_seeds(
    experiment: PickPlaceExperiment,
    seeds: Sequence[int | None],
    jobs: int | None = None,
    done: Callable[[int], None] | None = None,
) -> list[PickFigures]:
    """Run an experiment with several seeds, in processes of their own.

    Args:
        experiment: All other settings.
        seeds: Of the people; None for nobody.
        jobs: Processes, by default one a processor.
        done: Called with the number of runs that are done, whenever one is.

    Returns:
        Figures of each run, in the order of the seeds; the same whatever `jobs`.
    """
    jobs = min((os.cpu_count() or 1) if jobs is None else jobs, len(seeds))
    found = []
    if jobs > 1 and "fork" in multiprocessing.get_all_start_methods():
        _WORK.append(experiment)
        try:
            with multiprocessing.get_context("fork").Pool(jobs, initializer=_plain_signals) as pool:
                for item in pool.imap(_inherited, seeds):
                    found.append(item)
                    if done is not None:
                        done(len(found))
                pool.close()
                pool.join()
        finally:
            _WORK.clear()
    else:
        for seed in seeds:
            found.append(one(experiment, seed))
            if done is not None:
                done(len(found))
    return found


def one(experiment: PickPlaceExperiment, seed: int | None) -> PickFigures:
    """Figures of one run."""
    if seed is None:
        return figures(replace(experiment, people_file=None).run())
    return figures(replace(experiment, seed=seed).run(), seed)


_WORK: list[PickPlaceExperiment] = []  # inherited by forked processes, never pickled


def _plain_signals() -> None:
    """Let the parent alone answer Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _inherited(seed: int | None) -> PickFigures:
    return one(_WORK[0], seed)
