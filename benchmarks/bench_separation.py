"""What the rows of speed and separation monitoring take of a tick: python benchmarks/bench_separation.py [FILE.json].

Twenty points around the tool of a resting IRB 140, ticks of both controllers in turn; medians.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import qpsafe
from qpsafe.text.json_text import json_text

TICKS = 2000


def measured() -> dict[str, float]:
    """Median time of a tick without and with the rows [µs]."""
    robot, rng = qpsafe.load_robot("irb140"), np.random.default_rng(0)
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    rows = qpsafe.SeparationLimit(qpsafe.Separation(deceleration=3.0))
    made = {
        name: qpsafe.SafetyController(robot, tasks, separation=separation)
        for name, separation in (("without", None), ("with", rows))
    }
    around = rng.normal(size=(20, 3))
    points = here.pose[:3, 3] + 0.5 * around / np.linalg.norm(around, axis=1, keepdims=True)
    times = {name: np.empty(TICKS) for name in made}
    for k in range(TICKS):
        for name, controller in made.items():
            times[name][k] = 1e6 * controller.step(robot.home, np.zeros(robot.nq), points=points).solve_time
    return {name: float(np.median(values)) for name, values in times.items()}


def main() -> None:
    """Print and write it."""
    found = measured()
    print(f"median of a tick [µs]: {found['without']:.0f} without the rows, {found['with']:.0f} with them")
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
