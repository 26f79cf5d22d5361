"""Draw docs/img/tune-front.png and tune-matters.png from docs/data/tune.json: python docs/figures_tune.py."""

from pathlib import Path

import matplotlib
from noted import measured

from qpsafe.sim.drawing.plots import STYLE
from qpsafe.sim.tuning.figures import front_figure, sensitivity_figure
from qpsafe.text.figure_file import save

IMG = Path(__file__).resolve().parent / "img"


def draw() -> None:
    """Both, of the first run."""
    first = measured("tune")["runs"][0]
    with matplotlib.rc_context(STYLE):
        save(front_figure(first), IMG / "tune-front.png")
        save(sensitivity_figure(first["sensitivity"]), IMG / "tune-matters.png")


if __name__ == "__main__":
    draw()
