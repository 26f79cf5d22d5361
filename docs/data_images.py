"""Write docs/data/judged-images.json: the default controller by what it sees, on the first of the same encounters.

qpsafe campaign run --controllers default --seed 6000000 --sensor vl53l5cx --trials N --out FOLDER   # and others

Of folders in which `unheld` has run as well, docs/data/judged-standing.json says what standing links change, and where
`creeping` has, judged-friction.json what friction does; of those with ideal or Sharp sensors, judged-ideal.json and
judged-sharp.json say what came of the default. What is known of other sensors stays, and of more encounters as well.

python docs/data_images.py FOLDER...
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from noted import measured, note

#: Controllers that differ from the default in one thing -> where that is noted.
BESIDE = {"unheld": "judged-standing", "creeping": "judged-friction"}


def main() -> None:
    """Keep what reports say of the default controller, by its sensors."""
    found = measured("judged-images")
    beside: dict[str, dict[str, Any]] = {other: {} for other in BESIDE}
    for folder in sys.argv[1:]:
        report = json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))
        default = report["controllers"]["default"]
        assert report["trials"]["finished"] == default["trials"], folder
        for other in set(BESIDE) & set(report["controllers"]):
            less = [row for row in report["comparisons"] if (row["controller"], row["reference"]) == (other, "default")]
            both = {name: report["controllers"][name] for name in (other, "default")}
            beside[other][default["sensor"]] = {"controllers": both, "comparisons": less}
        if default["trials"] < found.get(default["sensor"], default)["trials"]:
            continue
        if default["sensor"] in ("ideal", "sharp"):
            own = {"controllers": {"default": default}, "comparisons": [], "references": ["default"]}
            note(f"judged-{default['sensor']}", report | own | {"worst": {"default": report["worst"]["default"]}})
        found[default["sensor"]] = default | {"seeds": report["seeds"], "code": report["versions"]}
    assert len({sensor["seeds"][0] for sensor in found.values()}) == 1, "other encounters"
    note("judged-images", found)
    for other, name in BESIDE.items():
        if beside[other]:
            note(name, measured(name) | beside[other])


if __name__ == "__main__":
    main()
