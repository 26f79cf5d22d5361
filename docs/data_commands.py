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

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "docs"))

from noted import note  # noqa: E402

#: Speeds between those of the fast person's table [m/s].
BETWEEN = " ".join(f"--speed {0.55 + 0.1 * k:.2f}" for k in range(15))
#: What is run; {out} stands for a file or folder that is not kept. A program of benchmarks/ writes the JSON there.
COMMANDS = {
    "fixed": "demo fixed --json --no-video --out {out}",
    "fixed-paper": "demo fixed --projection paper --json --no-video --out {out}",
    "fixed-weighted": "demo fixed --law weighted --json --no-video --out {out}",
    "fixed-nullspace": "demo fixed --law nullspace --json --no-video --out {out}",
    "robots": "demo fixed --robot all --json --no-video --out {out}",
    "path": "demo path --json --out {out}",
    "fast-person": "demo fast-person --json --out {out}",
    "fast-person-sharp": "demo fast-person --sensor sharp --json --out {out}",
    "fast-person-between": f"demo fast-person --experiment path {BETWEEN} --json --out {{out}}",
    "pick": "demo pick-and-place --seeds 10 --jobs 1 --json --out {out}",
    "compare": "compare --full --json",
    "place": "place --no-caps --json --no-pictures --out {out}",
    "place-share": "place --no-caps --probability 0.89 --json --no-pictures --out {out}",
    "place-caps": "place --no-exact --json --no-pictures --out {out}",
    "place-arrays": "place --sensor vl53l5cx --objective nearest --no-exact --json --no-pictures --out {out}",
    "ticks": "bench --json",
    "compilation": "bench --compile --json",
    "gate": "benchmarks/bench_gate.py {out}",
    "separation": "benchmarks/bench_separation.py {out}",
    "clearance": "benchmarks/clearance_runs.py {out}",
    "projection": "benchmarks/projection_residuals.py {out}",
    "walkers": "benchmarks/walkers_seen.py {out}",
    "stumbles": "benchmarks/stumbling_hands.py {out}",
    "gym": "benchmarks/bench_gym.py {out}",
    "plugin-ticks": "benchmarks/bench_plugins.py {out}",
    "other-robots": "benchmarks/other_robots.py {out}",
    "irc5-faults": "irc5-faults --moments 20 --jobs 1 --json",
    "camera-calibration": "benchmarks/camera_calibration.py --out {out}",
    "hqp-solvers": "benchmarks/bench_hqp.py --out {out}",
    "hqp-intervals": "benchmarks/hqp_intervals.py --count 20000 --seed 21 --json",
    "stream": "benchmarks/bench_stream.py --duration 60 --busy 0 2 --real-time yes --out {out}",
    "wire": "benchmarks/bench_wire.py --duration 20 --only-lock-step --out {out}",
}
#: What no page needs of them.
DROPPED = {"place-share": ("curves",), "place-caps": ("curves",)}


def main(names: list[str]) -> None:
    """Run some, or all."""
    for name in names or COMMANDS:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / f"{name}.json"
            words = [word.format(out=out) for word in COMMANDS[name].split()]
            program = words if words[0].endswith(".py") else ["-m", "qpsafe", *words]
            done = subprocess.run([sys.executable, *program], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
            text = out.read_text(encoding="utf-8") if out.is_file() else done.stdout
        found = json.loads(text)
        for key in DROPPED.get(name, ()):
            del found[key]
        if isinstance(found, dict):
            found.get("machine", {}).pop("system", None)  # the kernel's build says nothing to others
        note(name, found)
        print(f"{name}: exit code {done.returncode}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
