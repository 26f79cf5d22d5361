"""What the gate and the clearance rows take of a tick: python benchmarks/bench_gate.py [FILE.json].

The same encounter of the IRB 140 under four controllers, a tick of each in turn: with both, with one of them, with
neither. Somebody is in reach of the tool, or nobody is near. Medians of each tick, and their differences.
"""

import sys
from pathlib import Path

import numpy as np

import qpsafe
from qpsafe.text.json_text import json_text

TICKS = 5_000
KINDS = {"neither": ("off", "off"), "gate": (None, "off"), "rows": ("off", None), "both": (None, None)}


def controllers(robot: qpsafe.Robot) -> dict[str, qpsafe.SafetyController]:
    """A controller of each kind, over a floor and beside a table."""
    from qpsafe.sensing.hulls import Obstacle

    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    known = [
        Obstacle.box("floor", (6.0, 6.0, 0.5), (0.0, 0.0, -0.9)),
        Obstacle.box("table", (0.5, 1.0, 0.05), (0.9, 0, 0.1)),
    ]
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    return {
        name: qpsafe.SafetyController(robot, tasks, known=known, gate=gate, clearance=clearance)
        for name, (gate, clearance) in KINDS.items()
    }


def measured(near: bool) -> dict[str, float]:
    """Median time of a tick of each kind [µs].

    Args:
        near: Whether somebody goes to and fro in reach of the tool.
    """
    robot = qpsafe.load_robot("irb140")
    made, times = controllers(robot), {name: np.empty(TICKS) for name in KINDS}
    states = {name: (robot.home, np.zeros(robot.nq)) for name in KINDS}
    tip = robot.pose("tcp", robot.home)[:3, 3]
    for k in range(TICKS):
        ahead = 0.35 - 0.25 * np.sin(0.002 * k) ** 2
        person = tip + np.array((ahead, 0.05, 0.0))
        for name, controller in made.items():
            tick = controller.step(*states[name], points=[person] if near else [])
            states[name] = tick.reference.q, tick.reference.qd
            times[name][k] = 1e6 * tick.solve_time
    return {name: float(np.median(values)) for name, values in times.items()}


def main() -> None:
    """Print the table, and write it."""
    found = {"a person in reach": measured(near=True), "nobody near": measured(near=False)}
    print(
        f"{'median of a tick [µs]':<24}" + "".join(f"{name:>10}" for name in KINDS) + f"{'gate adds':>12}{'ratio':>8}"
    )
    for what, row in found.items():
        added = row["gate"] - row["neither"]
        cells = "".join(f"{value:>10.1f}" for value in row.values())
        print(f"{what:<24}{cells}{added:>12.1f}{added / row['neither']:>8.2f}")
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
