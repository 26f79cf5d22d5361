"""Write docs/data/perfect-sight.json: contacts that are left where everybody is seen, and which of them had to be.

qpsafe campaign run --controllers default --seed 2050000 --trials 300 --sensor perfect --out FOLDER
qpsafe campaign limit FOLDER
qpsafe campaign run --controllers none --seed 2050000 --trials 300 --sensor perfect --out NONE

python docs/data_floor.py FOLDER NONE
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from noted import note

from qpsafe.sim.campaign.limit.folder import stored_limits
from qpsafe.sim.campaign.report.statistics import share
from qpsafe.sim.campaign.runner import stored_results
from qpsafe.sim.campaign.trials.rows import Columns, of_controller

#: Of the contacts of a part of the robot: it stood; a motion without contact was found; surely there is none.
COUNTED = ("contacts", "rest", "avoidable", "surely")


def main(folder: Path, alone: Path) -> None:
    """Keep what is known of the contacts of a folder.

    Args:
        folder: Of the default controller with perfect sight, its limits searched.
        alone: The same encounters without control.
    """
    results = stored_results(folder)
    mine: Columns = of_controller(results.columns, "default")
    without: Columns = of_controller(stored_results(alone).columns, "none")
    assert np.array_equal(np.sort(mine["seed"]), np.sort(without["seed"])), "other encounters"
    limits = {item.trial: item for item in stored_limits(folder, results)["default"]}
    touched = np.flatnonzero(mine["contact"])
    assert set(mine["trial"][touched].tolist()) == set(limits), "run: qpsafe campaign limit"
    parts: dict[str, dict[str, int]] = {}
    for k in touched.tolist():
        limit = limits[int(mine["trial"][k])]
        part = parts.setdefault(str(mine["contact_frame"][k]), dict.fromkeys(COUNTED, 0))
        part["contacts"] += 1
        part["rest"] += not mine["moving"][k]
        part["avoidable"] += limit.avoidable
        part["surely"] += not limit.avoidable and limit.fixed <= 0.0
    avoided = {item.trial for item in limits.values() if item.avoidable}
    left = [bool(hit) and trial not in avoided for trial, hit in zip(mine["trial"], mine["contact"], strict=True)]
    note(
        "perfect-sight",
        {
            "encounters": len(mine["trial"]),
            "seeds": [int(mine["seed"].min()), int(mine["seed"].max())],
            **{"without": share(without["contact"])._asdict(), "contacts": share(mine["contact"])._asdict()},
            **{"moving": share(mine["moving"])._asdict(), "towards": share(mine["towards"])._asdict()},
            "left": share(left)._asdict(),
            "hands": int((mine["contact_region"][touched] == "hand").sum()),
            "parts": dict(sorted(parts.items(), key=lambda item: -item[1]["contacts"])),
            "lost": float(np.mean(mine["lost_time"])),
        },
    )


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
