"""Write docs/data/tune.json and its figures from folders of `qpsafe tune`: python docs/data_tune.py FOLDER ...

Of each run what the page needs is kept: the front, the choice, its judgement and what matters; of the first one all
trials, for the figure.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib

from qpsafe.sim.drawing.plots import STYLE
from qpsafe.sim.tuning.figures import front_figure, sensitivity_figure
from qpsafe.text.figure_file import save
from qpsafe.text.json_text import json_text

DOCS = Path(__file__).resolve().parent
DATA = DOCS / "data" / "tune.json"
KEPT = ("robot", "run", "sentence", "present", "chosen", "front", "judgement", "sensitivity", "search")


def short(said: dict[str, Any]) -> dict[str, Any]:
    """What is kept of a result."""
    whole = sum(trial["whole"] for trial in said["trials"])
    return {key: said[key] for key in KEPT} | {"tried": len(said["trials"]), "whole": whole}


def draw(first: dict[str, Any]) -> None:
    """Both figures of the page, of the first run."""
    with matplotlib.rc_context(STYLE):
        save(front_figure(first), DOCS / "img" / "tune-front.png")
        save(sensitivity_figure(first["sensitivity"]), DOCS / "img" / "tune-matters.png")


if __name__ == "__main__":
    results = [json.loads((Path(folder) / "tune.json").read_text(encoding="utf-8")) for folder in sys.argv[1:]]
    runs = [short(said) for said in results]
    runs[0]["trials"] = results[0]["trials"]
    DATA.write_text(json_text({"runs": runs}, indent=1) + "\n", encoding="utf-8")
    draw(runs[0])
