"""Write docs/data/tune.json and its figures from folders of `qpsafe tune`: python docs/data_tune.py FOLDER ...

Of each run what the page needs is kept: the front, the choice, its judgement and what matters; of the first one all
trials, for the figure.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from figures_tune import draw
from noted import DATA

from qpsafe.text.json_text import json_text

KEPT = ("robot", "run", "sentence", "present", "chosen", "front", "finals", "judgement", "sensitivity", "search")


def short(said: dict[str, Any]) -> dict[str, Any]:
    """What is kept of a result."""
    whole = sum(trial["whole"] for trial in said["trials"])
    return {key: said[key] for key in KEPT} | {"tried": len(said["trials"]), "whole": whole}


if __name__ == "__main__":
    results = [json.loads((Path(folder) / "tune.json").read_text(encoding="utf-8")) for folder in sys.argv[1:]]
    runs = [short(said) for said in results]
    runs[0]["trials"] = results[0]["trials"]
    (DATA / "tune.json").write_text(json_text({"runs": runs}, indent=1) + "\n", encoding="utf-8")
    draw()
