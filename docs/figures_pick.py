"""Draw the figures of the third experiment, the seeds' from docs/data/pick.json: python docs/figures_pick.py."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

from noted import measured

import qpsafe
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.experiments.pick_place.plots import seeds_figure, timeline
from qpsafe.sim.experiments.pick_place.report import PickFigures
from qpsafe.sim.experiments.pick_place.snapshots import draw

DOCS = Path(__file__).resolve().parent
IMG = DOCS / "img"


def figures_of(run: dict[str, Any]) -> PickFigures:
    """Figures of a run, as the command wrote them."""
    return PickFigures(**{field.name: run[field.name] for field in fields(PickFigures)})


def main() -> None:
    """Run seed 0 and draw it; then the seeds that were run for the page's table."""
    experiment = PickPlaceExperiment(qpsafe.load_robot("irb140"))
    run = experiment.run()
    timeline(run, [person.name for person in experiment.people], IMG / "demo-pick-time.png")
    draw(experiment, run, IMG / "demo-pick-snapshots.png")
    found = measured("pick")
    alone, runs = figures_of(found["without_people"]), [figures_of(run) for run in found["runs"]]
    seeds_figure(runs, alone, IMG / "demo-pick-seeds.png")


if __name__ == "__main__":
    main()
