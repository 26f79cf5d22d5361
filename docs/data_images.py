"""Write docs/data/judged-images.json: the default controller by what it sees, on the first of the same encounters.

qpsafe campaign run --controllers default --seed 6000000 --sensor vl53l5cx --trials N --out FOLDER   # and others
python docs/data_images.py FOLDER...
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from noted import note


def main() -> None:
    """Keep what reports say of the default controller, by its sensors."""
    found = {}
    for folder in sys.argv[1:]:
        report = json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))
        default = report["controllers"]["default"]
        assert report["trials"]["finished"] == default["trials"], folder
        found[default["sensor"]] = default | {"seeds": report["seeds"], "code": report["versions"]}
    assert len({sensor["seeds"][0] for sensor in found.values()}) == 1, "other encounters"
    note("judged-images", found)


if __name__ == "__main__":
    main()
