"""Draw docs/img/campaign.png and campaign-kinds.png from docs/data/campaign.json: python docs/figures_campaign.py."""

from pathlib import Path

import matplotlib
from noted import measured

from qpsafe.sim.campaign.report.figures import harm_figure, kinds_figure
from qpsafe.sim.drawing.plots import STYLE
from qpsafe.text.figure_file import save

DOCS = Path(__file__).resolve().parent

if __name__ == "__main__":
    controllers = measured("campaign")["controllers"]
    with matplotlib.rc_context(STYLE):
        save(harm_figure(controllers), DOCS / "img" / "campaign.png")
        save(kinds_figure(controllers), DOCS / "img" / "campaign-kinds.png")
