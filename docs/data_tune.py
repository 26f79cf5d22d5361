"""Write docs/data/tune.json and its figures from folders of `qpsafe tune`: python docs/data_tune.py FOLDER ...

Of each run what the page needs is kept: the front, the choice, its judgement and what matters; of the first one all
trials, for the figure. `--add FOLDER ...` keeps what is there, and adds or replaces these runs.

docs/data/tune-foreign.json, of an arm that nothing was tuned on, is written by

    python benchmarks/made_up_arm.py arm.urdf && qpsafe robots add arm.urdf --out arm
    qpsafe tune --robot arm --trials 49 --finals 200 --judge 450 --out tuned
    qpsafe demo fixed --no-video --parameters robot --robot arm --out before
    qpsafe demo fixed --no-video --parameters robot --robot tuned/robot --out after
    python docs/data_tune.py --foreign tuned before after
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


def foreign(tuned: str, before: str, after: str) -> dict[str, Any]:
    """What is kept of an arm that nothing was tuned on.

    Args:
        tuned: Folder of its tuning.
        before: Of its first experiment with the values that it had.
        after: Of the same with the tuned ones.
    """
    reports = {
        name: json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))
        for name, folder in (("before", before), ("after", after))
    }
    fixed = {
        name: {
            "kept": said["kept"],
            "missed": [check for check in said["checks"] if check["counts"] and not check["kept"]],
            "approaches": said["approaches"],
            "left_out": said["left_out"],
        }
        for name, said in reports.items()
    }
    return {"runs": [short(json.loads((Path(tuned) / "tune.json").read_text(encoding="utf-8")))], "fixed": fixed}


if __name__ == "__main__":
    if sys.argv[1] == "--foreign":
        text = json_text(foreign(*sys.argv[2:]), indent=1)
        (DATA / "tune-foreign.json").write_text(text + "\n", encoding="utf-8")
        raise SystemExit
    adding = sys.argv[1] == "--add"
    folders = map(Path, sys.argv[1 + adding :])
    results = [json.loads((folder / "tune.json").read_text(encoding="utf-8")) for folder in folders]
    kept = json.loads((DATA / "tune.json").read_text(encoding="utf-8"))["runs"] if adding else []
    runs = {(run["robot"], run["search"]["seed"]): run for run in [*kept, *map(short, results)]}
    if not adding:
        next(iter(runs.values()))["trials"] = results[0]["trials"]
    (DATA / "tune.json").write_text(json_text({"runs": list(runs.values())}, indent=1) + "\n", encoding="utf-8")
    draw()
