"""Write docs/data/NAME.json, each by the command that measures it: python docs/data_commands.py [NAME ...].

`python docs/campaign_tables.py` then fills the tables of the pages; tests/docs/test_figures_in_text.py holds their
sentences to the same files. Times are of the machine that runs this, which every page with times describes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from qpsafe.text.json_text import json_text

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "docs" / "data"
#: What is run; {out} stands for a file or folder that is not kept. A program of benchmarks/ writes the JSON there.
COMMANDS = {
    "fixed": "demo fixed --json --no-video --out {out}",
    "path": "demo path --json --out {out}",
    "fast-person": "demo fast-person --json --out {out}",
    "pick": "demo pick-and-place --seeds 10 --jobs 1 --json --out {out}",
    "compare": "compare --full --json",
    "place": "place --no-caps --json --no-pictures --out {out}",
    "place-share": "place --no-caps --probability 0.89 --json --no-pictures --out {out}",
    "place-caps": "place --no-exact --json --no-pictures --out {out}",
    "place-arrays": "place --sensor vl53l5cx --objective nearest --no-exact --json --no-pictures --out {out}",
    "ticks": "bench --json",
    "irc5-faults": "irc5-faults --moments 20 --jobs 1 --json",
    "camera-calibration": "benchmarks/camera_calibration.py --out {out}",
    "hqp-solvers": "benchmarks/bench_hqp.py --out {out}",
    "hqp-intervals": "benchmarks/hqp_intervals.py --count 20000 --seed 21 --json",
    "stream": "benchmarks/bench_stream.py --duration 60 --busy 0 2 --real-time yes --out {out}",
    "wire": "benchmarks/bench_wire.py --duration 20 --only-lock-step --out {out}",
}
#: What no page needs of them.
DROPPED = {"place-share": ("curves",), "place-caps": ("curves",)}


def rounded(value: Any) -> Any:
    """The same with six significant digits: pages show fewer."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return [rounded(item) for item in value] if isinstance(value, list) else value


def main(names: list[str]) -> None:
    """Run some, or all."""
    for name in names or COMMANDS:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / f"{name}.json"
            words = [word.format(out=out) for word in COMMANDS[name].split()]
            program = words if words[0].endswith(".py") else ["-m", "qpsafe", *words]
            done = subprocess.run([sys.executable, *program], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
            text = out.read_text(encoding="utf-8") if out.is_file() else done.stdout
        found = rounded(json.loads(text))
        for key in DROPPED.get(name, ()):
            del found[key]
        if isinstance(found, dict):
            found.get("machine", {}).pop("system", None)  # the kernel's build says nothing to others
        (DATA / f"{name}.json").write_text(json_text(found, indent=1) + "\n", encoding="utf-8")
        print(f"{name}: exit code {done.returncode}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
