"""Figures of the third experiment: one run over time, and what people cost over many days."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from qpsafe.danger.activation import Activation
from qpsafe.sim.drawing.plots import STYLE, plain, shade
from qpsafe.sim.experiments.pick_place.experiment import PickRun
from qpsafe.sim.experiments.pick_place.report import PickFigures, cost
from qpsafe.text.figure_file import save
from qpsafe.text.words import counted

BLUE, RED, GREEN, GREY, OCHRE = "#0b5fa5", "#c0392b", "#2a8c3c", "#555555", "#b07a00"
ROWS = (
    ("grip", ("grip",), BLUE, "^"),
    ("delivered", ("delivered",), GREEN, "v"),
    ("person takes", ("take",), RED, "o"),
    ("person places", ("place",), OCHRE, "s"),
    ("missed or lost", ("miss", "empty", "lost"), "black", "x"),
)


def timeline(run: PickRun, people: Sequence[str], path: Path, title: str = "") -> None:
    """Danger, distance to people, the path's clock, and what happened to screws; medium shaded yellow, high red.

    Args:
        run: The run.
        people: Names, for the labels.
        path: PNG or PDF to write.
        title: Above the figure.
    """
    import matplotlib
    from matplotlib.figure import Figure

    log = run.log
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 6.4), layout="constrained")
        axes = figure.subplots(4, 1, sharex=True, height_ratios=(1.0, 1.0, 1.0, 0.9))
        for axis in axes:
            shade(axis, log)
        axes[0].plot(log.time, log.cdf_n, color=BLUE, linewidth=0.8)
        for threshold, name in zip(Activation().thresholds, ("high", "medium"), strict=True):
            axes[0].axhline(threshold.start, color=GREY, linestyle="--", linewidth=0.8)
            axes[0].text(0.5, threshold.start + 0.2, f"{name} above {threshold.start:.1f}", fontsize=7, color=GREY)
        axes[0].set(ylabel="CDFₙ [1/m]", ylim=(0.0, max(12.0, 1.05 * float(np.nanmax(log.cdf_n)))))
        near = np.where(log.person_distance < 3.0, log.person_distance, np.nan)
        axes[1].plot(log.time, near, color=BLUE, linewidth=0.8)
        axes[1].set(ylabel="robot to person\n[m]", ylim=(0.0, 1.5))
        axes[2].plot(log.time, run.path_time, color=BLUE)
        axes[2].plot(log.time, log.time, color=GREY, linestyle=":", label="undisturbed")
        axes[2].set(ylabel="path's clock\n[s]")
        axes[2].legend(loc="upper left")
        labels = []
        for row, (name, kinds, colour, marker) in enumerate(ROWS):
            times = run.times(*kinds)
            axes[3].plot(times, np.full(len(times), -row), linestyle="none", color=colour, marker=marker, markersize=5)
            labels.append(f"{name} ({len(times)})")
        last = -np.inf
        for event in (e for e in run.events if e.kind in ("take", "place")):
            time = event.tick * log.dt
            if time > last + 5.0:  # one name for what is done in one visit
                row = 2 if event.kind == "take" else 3
                axes[3].annotate(
                    f"{plain(people[event.person])} ", (time - 0.8, -row), fontsize=7, va="center", ha="right"
                )
            last = time
        axes[3].set(yticks=-np.arange(len(ROWS)), yticklabels=labels, ylim=(0.6 - len(ROWS), 0.6), xlabel="time [s]")
        axes[3].set_xlim(0.0, log.time[-1])
        if title:
            figure.suptitle(plain(title), fontsize=10)
        save(figure, path)


def seeds_figure(runs: Sequence[PickFigures], alone: PickFigures, path: Path) -> None:
    """Cycle times of every run, the undisturbed ones, and the mean cost of people per cycle.

    Args:
        runs: Figures of every seed.
        alone: Those of the run without people.
        path: The file to write.
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.0), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(2.0, 1.0))
        for item in runs:
            left.plot([item.seed] * len(item.cycle_times), item.cycle_times, ".", color=BLUE, markersize=4)
        left.axhline(float(np.median(alone.cycle_times)), color=GREY, linestyle="--", label="without people (median)")
        left.set(xlabel="seed", ylabel="time of a cycle [s]", ylim=(0.0, None))
        left.xaxis.get_major_locator().set_params(integer=True)
        left.legend(loc="lower right")
        costs = np.array([cost(item, alone) for item in runs])
        right.boxplot(costs, widths=0.4, showfliers=False)
        right.plot(1.0 + 0.02 * np.linspace(-5, 5, len(costs)), costs, ".", color=BLUE, markersize=5)
        right.set(
            ylabel="cost of people [s per cycle]",
            xticks=[1],
            xticklabels=[counted(len(runs), "seed")],
            ylim=(0.0, None),
        )
        save(figure, path)
