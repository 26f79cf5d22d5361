"""Timing of the loop's parts: percentiles of many single calls, compilation excluded."""

from __future__ import annotations

import gc
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np

from qpsafe.controller import SafetyController
from qpsafe.danger.field import DangerField
from qpsafe.laws.problem import Law
from qpsafe.robot.loader import load_robot
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.trajectory import FixedPose


class Times(NamedTuple):
    """Percentiles of wall times [s]."""

    runs: int
    median: float
    p99: float
    p999: float
    maximum: float


def time_calls(
    call: Callable[[int], Any], runs: int, warm_up: int = 200, progress: Callable[[], None] | None = None
) -> Times:
    """Time `call(k)` for k = 0 .. runs-1 one by one, after `warm_up` calls that do not count.

    The garbage collector is off while timing, as a 250 Hz loop would have it.
    """
    for k in range(warm_up):
        call(k)
    taken = np.empty(runs)
    gc.collect()
    gc.disable()
    try:
        for k in range(runs):
            start = time.perf_counter()
            call(k)
            taken[k] = time.perf_counter() - start
            if progress is not None:
                progress()
    finally:
        gc.enable()
    return Times(runs, *(float(value) for value in np.percentile(taken, (50.0, 99.0, 99.9, 100.0))))


def time_danger_field(runs: int, progress: Callable[[], None] | None = None) -> Times:
    """Value and gradient at 20 points around the moving IRB 140 (6 links)."""
    robot, rng, field = load_robot("irb140"), np.random.default_rng(0), DangerField()
    wire = robot.wire(robot.home, rng.normal(size=6))
    points = rng.uniform(-1.0, 1.0, (20, 3)) + np.array([0.3, 0.0, 0.6])
    return time_calls(lambda _: field.evaluate(points, wire), runs, progress=progress)


def time_ticks(law: Law, runs: int, progress: Callable[[], None] | None = None) -> Times:
    """`SafetyController.step` of the IRB 140 with all 20 spots detecting, through all regimes.

    The distances sweep slowly from 0.78 m to 0.3 m and back, so that every regime and transition occurs; the robot
    follows its references exactly.
    """
    robot = load_robot("irb140")
    target = FixedPose(robot.pose("tcp", robot.home))
    controller = SafetyController(robot, [PositionTask("tcp", target), OrientationTask("tcp", target)], law)
    state = {"q": robot.home, "qd": np.zeros(6)}
    count = len(controller.spots) if controller.spots is not None else 0
    offsets = np.random.default_rng(1).uniform(-0.02, 0.02, count)

    def tick(k: int) -> None:
        distances = 0.54 + 0.22 * np.cos(2.0 * np.pi * k / 2500.0) + offsets
        reference = controller.step(state["q"], state["qd"], distances).reference
        state["q"], state["qd"] = reference.q, reference.qd

    return time_calls(tick, runs, progress=progress)


def machine() -> dict[str, str]:
    """What the figures were measured on."""
    packages = ("numpy", "numba", "pin", "qpsolvers", "daqp", "mujoco")
    return {
        "processor": _processor(),
        "system": platform.platform(),
        "python": platform.python_version(),
        **{name: version(name) for name in packages},
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
