"""Write docs/data/verified.json or judged-stop.json from campaigns of several days, encounter by encounter.

qpsafe campaign run --controllers default,brisk --seed 6000000 --trials 3000 --out DEFAULT
qpsafe campaign run --controllers stop --seed 6000000 --trials 3000 --out STOP
python docs/data_paired.py judged-stop DEFAULT STOP

Controllers that are played tick by tick take ten times as long as the default, and seldom change: their encounters may
be of earlier days, as long as they are the same, which seed and motion tell. Where folders hold the same encounter of a
controller, the first one counts.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from noted import note

from qpsafe.sim.campaign.report.summary import summary
from qpsafe.sim.campaign.runner import Results
from qpsafe.sim.campaign.store import read, stored_plan, stored_versions
from qpsafe.sim.campaign.trials.rows import Columns, joined, of_controller

#: So many that a difference which no resample contradicts is below 0.001 after the correction for all comparisons.
RESAMPLES = 60_000
#: Which controllers each file compares.
CONTROLLERS = {
    "verified": ("none", "stop", "strict", "unverified", "separation", "default"),
    "judged-stop": ("default", "brisk", "stop"),
}


def rows(folders: list[Path], name: str) -> Columns:
    """All that folders know of a controller, by seed, each encounter once.

    Args:
        folders: Of campaigns.
        name: The controller's.
    """
    plans = [(folder, stored_plan(folder)) for folder in folders]
    parts = [of_controller(read(folder, plan).columns, name) for folder, plan in plans if name in plan.controllers]
    together = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    _, first = np.unique(together["seed"], return_index=True)
    return {key: values[first] for key, values in together.items()}


def main(name: str, folders: list[Path]) -> None:
    """Pair what all have met, and report it.

    Args:
        name: Of the file.
        folders: Of campaigns.
    """
    plan = stored_plan(folders[0])
    found = {controller: rows(folders, controller) for controller in CONTROLLERS[name]}
    seeds = found["default"]["seed"]
    for columns in found.values():
        seeds = np.intersect1d(seeds, columns["seed"])
    met = []
    for columns in found.values():
        picked = {key: values[np.searchsorted(columns["seed"], seeds)] for key, values in columns.items()}
        met.append(picked | {"trial": (seeds - plan.seed).astype(columns["trial"].dtype)})
        assert (picked["motion"] == met[0]["motion"]).all(), "other encounters"
    pair = replace(plan, controllers=CONTROLLERS[name], trials=len(seeds))
    results = Results(pair, joined(met, pair.controllers), 0.0, None, stored_versions(folders[0]))
    note(name, summary(results, resamples=RESAMPLES))
    print(f"{len(seeds):,} encounters")


if __name__ == "__main__":
    main(sys.argv[1], [Path(folder) for folder in sys.argv[2:]])
