"""Draw docs/img/placement-*.png: `qpsafe place` for the IRB 140 as shipped, its pictures, and arrays beside spots.

The last is drawn from docs/data/place.json and place-arrays.json.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib
import numpy as np

from qpsafe.sim.drawing.plots import STYLE
from qpsafe.text.figure_file import save

DOCS = Path(__file__).parent
IMG = DOCS / "img"
FIGURES = {"figure-9.png": "placement-figure-9", "nodes.png": "placement-nodes", "spots.png": "placement-spots"}


def main() -> None:
    """Run the command and take its figures."""
    with tempfile.TemporaryDirectory() as folder:
        code = "from qpsafe.cli.main import main; main()"
        subprocess.run([sys.executable, "-c", code, "place", "--no-exact", "--out", folder], check=True)
        for name, target in FIGURES.items():
            shutil.copy(Path(folder) / name, IMG / f"{target}.png")
    arrays_beside_spots()


MOST = 60  # sensors that are shown
LOOKS = {
    ("place", "detection"): ("Sharp, by detection", "#555555", "-"),
    ("place", "nearest"): ("Sharp, by nearest", "#555555", "--"),
    ("place-arrays", "detection"): ("arrays, by detection", "#0b5fa5", "-"),
    ("place-arrays", "nearest"): ("arrays, by nearest", "#0b5fa5", "--"),
}


def arrays_beside_spots() -> None:
    """Detection, cost, danger measured and nearest part seen as in Fig. 9, by how many sensors of either kind."""
    import matplotlib.pyplot as plt

    with matplotlib.rc_context(STYLE):
        figure, axes = plt.subplots(2, 2, figsize=(8.4, 6.4), sharex=True, layout="constrained")
        seen, near, danger, cost = axes.ravel()
        for (name, objective), (label, colour, style) in LOOKS.items():
            text = (DOCS / "data" / f"{name}.json").read_text(encoding="utf-8")
            curve = json.loads(text)["curves"][objective]
            k = np.arange(MOST + 1)
            for axis, share, limits in ((seen, "probability", "confidence"), (near, "nearest", "nearest_confidence")):
                low, high = np.array(curve[limits])[:, : MOST + 1]
                axis.fill_between(k, low, high, color=colour, alpha=0.2, linewidth=0)
                axis.plot(k, curve[share][1][: MOST + 1], style, color=colour, label=label)
            for axis, what in ((danger, "danger"), (cost, "cost")):
                axis.plot(k, curve[what][1][: MOST + 1], style, color=colour)
        titles = ("detected", "nearest part seen", "danger measured, of max SDF", "cost (11) per pair and node [1/m]")
        for axis, title in zip(axes.ravel(), titles, strict=True):
            axis.set_title(title)
            axis.set_xlim(0, MOST)
            if axis is not cost:
                axis.set_ylim(0.0, 1.02)
        for axis in axes[1]:
            axis.set_xlabel("number of sensors")
        seen.legend(loc="lower right", fontsize=8)
        save(figure, IMG / "placement-arrays.png")
        plt.close(figure)


if __name__ == "__main__":
    main()
