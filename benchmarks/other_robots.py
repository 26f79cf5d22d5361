"""The demos on models of other packages: python benchmarks/other_robots.py [FILE.json].

Needs the extra `models`. Of each command: its exit code, what it did not keep, or why it refused.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from qpsafe.text.json_text import json_text

PACKAGE = "example_robot_data"
FIXED = ("ur5", "panda", "xarm7", "kinova")
RUNS = {f"fixed {name}": f"demo fixed --no-video --robot {PACKAGE}:{name}" for name in FIXED} | {
    "path xarm7": f"demo path --robot {PACKAGE}:xarm7",
    "pick ur5": f"demo pick-and-place --cycles 3 --robot {PACKAGE}:ur5",
    "pick panda": f"demo pick-and-place --cycles 3 --robot {PACKAGE}:panda",
    "pick irb14000": "demo pick-and-place --cycles 3 --robot irb14000",
}


def run(words: str) -> dict[str, Any]:
    """A command in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "qpsafe", *words.split(), "--json", "--out", folder]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.stdout:
        return {"code": done.returncode, "refused": " ".join(done.stderr.rpartition("qpsafe: ")[2].split())}
    report = json.loads(done.stdout)
    missed = [check for check in report["checks"] if check["counts"] and not check["kept"]]
    kept = {key: report[key] for key in ("approaches", "runs") if key in report}
    return {"code": done.returncode, "missed": missed, **kept}


def main() -> None:
    """Run them all."""
    found = {}
    for name, words in RUNS.items():
        found[name] = run(words)
        print(name, {key: value for key, value in found[name].items() if key not in ("approaches", "runs")}, flush=True)
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
