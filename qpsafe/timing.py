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
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.sensing.spots import load_spots
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.trajectory import FixedPose

_STRIDE = 250  # calls between two words to a progress bar, which would push what is timed out of the caches


class Times(NamedTuple):
    """Percentiles of wall times [s]."""

    runs: int
    median: float
    p99: float
    p999: float
    maximum: float


def time_calls(
    call: Callable[[int], Any],
    runs: int,
    warm_up: int = 200,
    progress: Callable[[int], None] | None = None,
    collector: str = "off",
) -> Times:
    """Time `call(k)` for k = 0 .. runs-1 one by one, after `warm_up` calls that do not count.

    Args:
        call: What is timed.
        runs: How often.
        warm_up: Calls before.
        progress: Told now and then how many calls have been made since it was told last.
        collector: The garbage collector while timing: "off", as a 250 Hz loop would have it; "on"; or "frozen", on, but
            after `gc.freeze` it does not look at what was there before.
    """
    for k in range(warm_up):
        call(k)
    taken = np.empty(runs)
    gc.collect()
    if collector == "off":
        gc.disable()
    elif collector == "frozen":
        gc.freeze()
    try:
        for k in range(runs):
            start = time.perf_counter()
            call(k)
            taken[k] = time.perf_counter() - start
            if progress is not None and k % _STRIDE == _STRIDE - 1:
                progress(_STRIDE)
    finally:
        gc.enable()
        gc.unfreeze()
    return Times(runs, *(float(value) for value in np.percentile(taken, (50.0, 99.0, 99.9, 100.0))))


def time_danger_field(runs: int, progress: Callable[[int], None] | None = None) -> Times:
    """Value and gradient at 20 points around the moving IRB 140 (6 links)."""
    robot, rng, field = load_robot("irb140"), np.random.default_rng(0), DangerField()
    wire = robot.wire(robot.home, rng.normal(size=6))
    points = rng.uniform(-1.0, 1.0, (20, 3)) + np.array([0.3, 0.0, 0.6])
    return time_calls(lambda _: field.evaluate(points, wire), runs, progress=progress)


def time_sensing(runs: int, progress: Callable[[int], None] | None = None) -> Times:
    """From 20 readings to the points that count: the IRB 140 with a known floor and table, all filters on.

    The readings sweep slowly, with noise; two spots are sick now and then. The kinematics of the tick are not included.
    """
    robot, rng = load_robot("irb140"), np.random.default_rng(0)
    spots = load_spots(robot)
    assert spots is not None
    known = (Obstacle.box("floor", (6, 6, 0.5), (0, 0, -0.8)), Obstacle.box("table", (0.6, 1.0, 0.05), (0.8, 0, 0.3)))
    sensing = DistanceSensing(robot, spots, 0.004, SensingRules(velocities=True), known)
    state, wire = robot.at(robot.home), robot.wire(robot.home, np.zeros(6))
    sweep = 0.54 + 0.22 * np.cos(2.0 * np.pi * np.arange(500) / 500.0)
    readings = sweep[:, None] + rng.normal(0.0, 0.003, (500, len(spots)))
    readings[::50, :2] = np.nan
    return time_calls(lambda k: sensing.update(state, wire, readings[k % 500]), runs, progress=progress)


def time_ticks(
    law: Law,
    runs: int,
    progress: Callable[[int], None] | None = None,
    *,
    points: bool = False,
    collector: str = "off",
) -> Times:
    """`SafetyController.step` of the IRB 140 with all 20 spots detecting, through medium and high danger and back.

    The distances sweep slowly from 0.76 m to 0.32 m and back; the path is suspended and the robot recovers. It follows
    its references exactly.

    Args:
        law: The law.
        runs: Number of ticks.
        progress: Called now and then.
        points: Give the detected points themselves: everything but what is done to raw sensor readings.
        collector: As for `time_calls`.
    """
    robot = load_robot("irb140")
    target = FixedPose(robot.pose("tcp", robot.home))
    controller = SafetyController(robot, [PositionTask("tcp", target), OrientationTask("tcp", target)], law)
    assert controller.spots is not None
    offsets = np.random.default_rng(1).uniform(-0.02, 0.02, len(controller.spots))
    sweep = 0.54 + 0.22 * np.cos(2.0 * np.pi * np.arange(2500) / 2500.0)
    distances, home = [d + offsets for d in sweep], robot.at(robot.home)
    given = [controller.spots.points(home, d) for d in distances] if points else distances
    state = [np.array(robot.home), np.zeros(6)]

    def tick(k: int) -> None:
        reference = controller.step(state[0], state[1], given[k % 2500]).reference
        state[:] = reference.q, reference.qd

    return time_calls(tick, runs, progress=progress, collector=collector)


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
