"""Draw the figures of the third experiment: ``python docs/figures_pick.py``; with a number, that many seeds too."""

from __future__ import annotations

import sys
from pathlib import Path

import qpsafe
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.experiments.pick_place.plots import seeds_figure, timeline
from qpsafe.sim.experiments.pick_place.seeds import run_seeds
from qpsafe.sim.experiments.pick_place.snapshots import draw

IMG = Path(__file__).resolve().parent / "img"


def main() -> None:
    """Run seed 0 and draw it; then the seeds."""
    experiment = PickPlaceExperiment(qpsafe.load_robot("irb140"))
    run = experiment.run()
    timeline(run, [person.name for person in experiment.people], IMG / "demo-pick-time.png")
    draw(experiment, run, IMG / "demo-pick-snapshots.png")
    if len(sys.argv) > 1:
        alone, *found = run_seeds(experiment, [None, *range(int(sys.argv[1]))])
        seeds_figure(found, alone, IMG / "demo-pick-seeds.png")


if __name__ == "__main__":
    main()
