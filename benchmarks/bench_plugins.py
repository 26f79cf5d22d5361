"""What the plug-ins take of a loop of mink: python benchmarks/bench_plugins.py [FILE.json].

Processor time of one tick with twenty points around the tool: mink alone, with evasion and the joint limit, with the
cap on danger, too; the kinds take turns, tick by tick.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import mink
import mujoco
import numpy as np

import qpsafe
from qpsafe.plugins.mink import DangerLimit, DangerMonitor, EvasiveTask, JointLimit
from qpsafe.text.json_text import json_text

DT, TICKS = 0.004, 1500


def loop(robot: qpsafe.Robot, evades: bool, capped: bool) -> Callable[[int], None]:
    """A tick of a loop in which the tool swings among points.

    Args:
        robot: Of the loop.
        evades: Whether it has the evasive task and qpsafe's joint limit, else mink's limits.
        capped: Whether the danger has a cap, too.
    """
    model, tool = mujoco.MjModel.from_xml_path(str(robot.model_path)), robot.tool_frames[0]
    configuration, start = mink.Configuration(model, q=robot.home.copy()), robot.pose(tool, robot.home)
    frame = mink.FrameTask(tool, "site", position_cost=1.0, orientation_cost=0.3, gain=0.05)
    danger, rng = DangerMonitor(robot, DT), np.random.default_rng(0)
    around = rng.normal(size=(20, 3))
    points = start[:3, 3] + 0.5 * around / np.linalg.norm(around, axis=1, keepdims=True)
    tasks, limits = [frame, mink.DampingTask(model, 0.01)], [mink.ConfigurationLimit(model)]
    if evades:
        tasks, limits = [*tasks, EvasiveTask(danger)], [JointLimit(danger)]
    if capped:
        limits = [*limits, DangerLimit(danger, delta_max=danger_of(robot))]
    speeds = [np.zeros(robot.nq)]

    def tick(k: int) -> None:
        pose = start.copy()
        pose[1, 3] += 0.1 * np.sin(0.01 * k)
        frame.set_target(mink.SE3.from_matrix(pose))
        if evades:
            danger.update(configuration.q, speeds[0], points)
        speeds[0] = mink.solve_ik(configuration, tasks, DT, "daqp", limits=limits)
        configuration.integrate_inplace(speeds[0], DT)

    return tick


def danger_of(robot: qpsafe.Robot) -> float:
    """The robot's Δ, as a cap."""
    return float(qpsafe.robot_activation(robot, *2 * [len(robot.tool_frames)]).thresholds[0].delta)


def measured(name: str) -> dict[str, dict[str, float]]:
    """Median and 99th percentile of each kind [µs]."""
    robot, kinds = qpsafe.load_robot(name), {"mink": (False, False), "evades": (True, False), "capped": (True, True)}
    ticks = {kind: loop(robot, *parts) for kind, parts in kinds.items()}
    spent: dict[str, list[float]] = {kind: [] for kind in kinds}
    for k in range(TICKS):
        for kind, tick in ticks.items():
            begin = time.thread_time()
            tick(k)
            spent[kind].append(1e6 * (time.thread_time() - begin))
    late = {kind: np.array(values[100:]) for kind, values in spent.items()}
    return {kind: {"median": float(np.median(x)), "p99": float(np.percentile(x, 99))} for kind, x in late.items()}


def main() -> None:
    """Print and write it."""
    found = {name: measured(name) for name in ("irb140", "irb14000")}
    print(found)
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
