"""How much of the margin rows of clearance keep: python benchmarks/clearance_runs.py [FILE.json].

Goals jump by up to half a metre beside a turned box and a floor, on every bundled arm. Of each run: whether a row
bound, and the smallest true distance of all that may not meet, without the gate and with it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import qpsafe
from qpsafe.geometry.measure import nearest_of
from qpsafe.geometry.solids import Solids
from qpsafe.sensing.hulls import Obstacle
from qpsafe.tasks.rotation import exp3
from qpsafe.text.json_text import json_text

NOBODY = np.zeros((0, 3))
MARGIN = 0.004
SEEDS = 40


def tasks_at(robot: Any, shift: Any) -> list[Any]:
    """Every tool at its pose at home, shifted."""
    made: list[Any] = []
    for kind in (qpsafe.PositionTask, qpsafe.OrientationTask):
        for frame in robot.tool_frames:
            goal = robot.pose(frame, robot.home)
            goal[:3, 3] += shift
            made.append(kind(frame, qpsafe.FixedPose(goal)))
    return made


def controller_at(robot: Any, tasks: list[Any], known: Any, **parts: Any) -> Any:
    """A controller beside known obstacles, without the gate."""
    tools = len(robot.tool_frames)
    activation = qpsafe.robot_activation(robot, tools, tools) if tools > 1 else None
    return qpsafe.SafetyController(robot, tasks, activation=activation, known=known, **({"gate": "off"} | parts))


def distances(robot: Any, known: Any) -> Callable[[Any], float]:
    """Smallest distance of all that may not meet, at q."""
    solids = Solids.of(robot, known)
    pairs = np.vstack((solids.furniture, solids.own))
    return lambda q: nearest_of(solids.solid, robot.at(q).body_poses(), pairs, 0.2).distance


def run(controller: Any, ticks: int, seen: Any = lambda q: NOBODY) -> Iterator[Any]:
    """Ticks with perfect following."""
    q, qd = controller.robot.home.copy(), np.zeros(controller.robot.nq)
    for _ in range(ticks):
        tick = controller.step(q, qd, points=seen(q))
        assert tick.status in ("ok", "degraded"), tick
        q, qd = tick.reference.q, tick.reference.qd
        yield tick


def cell(robot: Any, rng: np.random.Generator) -> list[Obstacle]:
    """A floor under the tool, and a turned box near it."""
    place = robot.pose(robot.tool_frames[0], robot.home)[:3, 3]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = exp3(rng.normal(size=3)), place + rng.uniform(-0.35, 0.35, 3)
    floor = Obstacle.box("floor", (4.0, 4.0, 0.5), (0.0, 0.0, place[2] - 0.55))
    return [floor, Obstacle.box("box", rng.uniform(0.05, 0.3, 3), pose=pose)]


def kept(robot: Any, seed: int, **parts: Any) -> tuple[float, bool] | None:
    """Smallest distance while three goals follow each other in an instant [m], and whether a row bound.

    Args:
        robot: Any.
        seed: Of cell and goals; none is run where something is too near from the start.
        parts: Of the controller: `clearance`, `gate`.
    """
    rng = np.random.default_rng(seed)
    known = cell(robot, rng)
    gap = distances(robot, known)
    if gap(robot.home) < MARGIN:
        return None
    goals = rng.uniform(-0.5, 0.5, (3, 3))
    controller = controller_at(robot, tasks_at(robot, goals[0]), known, **parts)
    smallest, bound = np.inf, False
    for k, tick in enumerate(run(controller, 210)):
        if k % 70 == 69:
            controller.set_tasks(tasks_at(robot, goals[k // 70]))
        smallest = min(smallest, gap(tick.reference.q)) if k % 2 == 0 else smallest
        bound = bound or bool(tick.clearance)
    return smallest, bound


def main() -> None:
    """Run them all, and write what was found."""
    runs = []
    for name in qpsafe.bundled_robots():
        robot = qpsafe.load_robot(name)
        for seed in range(SEEDS):
            rows, both = kept(robot, seed), kept(robot, seed, gate=None)
            if rows is not None and both is not None:
                found = {"smallest": rows[0], "bound": rows[1], "with_gate": both[0]}
                runs.append({"robot": name, "seed": seed, **found})
    near = [one for one in runs if one["bound"]]
    print(f"{len(runs)} runs, rows bind in {len(near)}")
    for what in ("smallest", "with_gate"):
        print(f"{what} [mm]:", *(f"{1e3 * d:.1f}" for d in sorted(one[what] for one in near)))
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text({"margin": MARGIN, "runs": runs}) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
