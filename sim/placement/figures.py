"""Fig. 9 and the comparison of the objectives, as matplotlib figures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.placement.statistics import clopper_pearson
from qpsafe.sim.drawing.plots import plain
from qpsafe.text.figure_file import save
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.placement.study import Study

COLOURS = {
    "cost": "#555555",
    "detection": "#0b5fa5",
    "nearest": "#8e44ad",
    "danger": "#c0392b",
    "evasion": "#2e8b57",
}
DASHES: dict[str, Any] = {
    "cost": (4, 1.5),
    "detection": (),
    "nearest": (9, 2),
    "danger": (6, 1.5, 1.5, 1.5),
    "evasion": (1.5, 1.2),
}
LABELS = {
    "cost": "cost, (10)-(12)",
    "detection": "detection, greedy (13)",
    "nearest": "nearest part seen",
    "danger": "danger seen by each link",
    "evasion": "evasive torque of each link",
}
#: What the paper reports: spots, detection probability.
SOURCE = (20, 0.89)


def figure_9(result: Study, path: Path, title: str) -> None:
    """Detection, cost, danger measured and nearest part seen over the number of spots; written whole or not at all.

    Args:
        result: The study.
        path: The file to write.
        title: Of the figure.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    style = {
        "font.size": 9,
        "axes.grid": True,
        "grid.color": "#d0d0d0",
        "grid.linewidth": 0.5,
        "legend.fontsize": 8,
        "savefig.dpi": 160,
    }
    with plt.rc_context(style):
        figure, axes = plt.subplots(4, 1, figsize=(7.2, 10.6), sharex=True, layout="constrained")
        optimised, independent = result.samples
        for name, curve in result.curves.items():
            k = np.arange(len(curve.order) + 1)
            look: dict[str, Any] = {"color": COLOURS[name], "dashes": DASHES[name]}
            low, high = clopper_pearson(curve.counts[1], independent.pairs)
            axes[0].fill_between(k, low, high, color=COLOURS[name], alpha=0.25, linewidth=0)
            axes[0].plot(k, curve.counts[1] / independent.pairs, label=LABELS[name], **look)
            axes[0].plot(k, curve.counts[0] / optimised.pairs, color=COLOURS[name], linewidth=0.5)
            if name == "cost":  # the others' bands are as wide: most of it is max SDF, which all have in common
                low, high = (curve.cost[1] + side * 1.96 * curve.cost_error[1] for side in (-1, 1))
                axes[1].fill_between(k, low, high, color=COLOURS[name], alpha=0.25, linewidth=0)
            axes[1].plot(k, curve.cost[1], **look)
            axes[2].plot(k, curve.danger[1], **look)
            axes[2].plot(k, curve.danger[0], color=COLOURS[name], linewidth=0.5)
            low, high = clopper_pearson(curve.nearest[1], independent.pairs)
            axes[3].fill_between(k, low, high, color=COLOURS[name], alpha=0.25, linewidth=0)
            axes[3].plot(k, curve.nearest[1] / independent.pairs, **look)
            axes[3].plot(k, curve.nearest[0] / optimised.pairs, color=COLOURS[name], linewidth=0.5)
        if not result.candidates.sensor.is_array:
            axes[0].plot(*SOURCE, "k*", markersize=9, label="the paper: 20 spots, 89 %")
        answer = result.answer
        axes[0].plot(
            len(answer.solution.chosen), answer.fair.probability, "o", color="black", fillstyle="none", label="chosen"
        )
        axes[3].plot(len(answer.solution.chosen), answer.fair.nearest, "o", color="black", fillstyle="none")
        axes[0].set_ylabel("detection probability")
        axes[0].set_ylim(0.0, 1.02)
        axes[0].legend(loc="lower right")
        axes[1].set_ylabel("cost (11) per pair and node [1/m]")
        axes[2].set_ylabel("danger measured, of max SDF")
        axes[2].set_ylim(0.0, 1.02)
        axes[3].set_ylabel("nearest part seen")
        axes[3].set_ylim(0.0, 1.02)
        axes[3].set_xlabel("number of arrays" if result.candidates.sensor.is_array else "number of spots")
        axes[3].set_xlim(0, len(curve.order))
        figure.suptitle(
            f"{plain(title)}, {result.candidates.sensor.name}: {counted(len(curve.order), 'node')}.\nThick: "
            f"{counted(independent.pairs, 'independent pair')} with 95 % bands; thin: optimised pairs",
            fontsize=9,
        )
        try:
            save(figure, path)
        finally:
            plt.close(figure)
