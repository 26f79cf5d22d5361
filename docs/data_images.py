"""Write docs/data/judged-images.json: the default controller by what it sees, on the first of the same encounters.

qpsafe campaign run --controllers default --seed 6000000 --sensor vl53l5cx --trials N --out FOLDER   # and others

Of folders in which `unheld` has run as well, docs/data/judged-standing.json says what standing links change; of those
with ideal or Sharp sensors, docs/data/judged-ideal.json and judged-sharp.json what came of the default.

python docs/data_images.py FOLDER...
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from noted import note


def main() -> None:
    """Keep what reports say of the default controller, by its sensors."""
    found, standing = {}, {}
    for folder in sys.argv[1:]:
        report = json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))
        default = report["controllers"]["default"]
        assert report["trials"]["finished"] == default["trials"], folder
        if "unheld" in report["controllers"]:
            less = [
                row for row in report["comparisons"] if (row["controller"], row["reference"]) == ("unheld", "default")
            ]
            standing[default["sensor"]] = {"controllers": report["controllers"], "comparisons": less}
        if default["sensor"] in ("ideal", "sharp"):
            own = {"controllers": {"default": default}, "comparisons": [], "references": ["default"]}
            note(f"judged-{default['sensor']}", report | own | {"worst": {"default": report["worst"]["default"]}})
        found[default["sensor"]] = default | {"seeds": report["seeds"], "code": report["versions"]}
    assert len({sensor["seeds"][0] for sensor in found.values()}) == 1, "other encounters"
    note("judged-images", found)
    if standing:
        note("judged-standing", standing)


if __name__ == "__main__":
    main()
