"""What of the project is timed: the whole tick in its kinds, and its parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from qpsafe.batch.controller import BatchController
from qpsafe.bench.clock import Row
from qpsafe.bench.images import arrays, dense
from qpsafe.controller import SafetyController
from qpsafe.danger.field import DangerField
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.problem import Law
from qpsafe.laws.weighted import WeightedLaw
from qpsafe.robot.loader import load_robot
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.sensing.skin.spots import load_spots
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.trajectory import FixedPose

#: What a robot with its own sensors runs; everything else is beside it.
MAIN = "whole tick, 20 distances"
#: The same with arrays in place of spots; and one image of a depth camera.
ARRAYS, DENSE = "whole tick, 20 arrays of 64 zones at 15 Hz", "one depth image, 640 x 480, reduced"
#: Robots of a batch.
ROBOTS = 1000


class OwnTask(PositionTask):
    """A task of three rows of somebody's own making: asked method by method, in Python."""

    def error(self, value: np.ndarray, sample: Any) -> np.ndarray:
        """Like its parent's; but that is not known to compiled code."""
        return super().error(value, sample)


def danger_field() -> Callable[[int], Any]:
    """Value and gradient at 20 points around the moving IRB 140 (6 links)."""
    robot, rng, field = load_robot("irb140"), np.random.default_rng(0), DangerField()
    wire = robot.wire(robot.home, rng.normal(size=6))
    points = rng.uniform(-1.0, 1.0, (20, 3)) + np.array([0.3, 0.0, 0.6])
    return lambda _: field.evaluate(points, wire)


def sensing() -> Callable[[int], Any]:
    """From 20 readings to the points that count: the IRB 140 with a known floor and table, all filters on.

    The readings sweep slowly, with noise; two spots are sick now and then. The kinematics of the tick are not included.
    """
    robot, rng = load_robot("irb140"), np.random.default_rng(0)
    spots = load_spots(robot)
    assert spots is not None
    known = (Obstacle.box("floor", (6, 6, 0.5), (0, 0, -0.8)), Obstacle.box("table", (0.6, 1.0, 0.05), (0.8, 0, 0.3)))
    sensors = DistanceSensing(robot, spots, 0.004, SensingRules(velocities=True), known)
    state, wire = robot.at(robot.home), robot.wire(robot.home, np.zeros(6))
    sweep = 0.54 + 0.22 * np.cos(2.0 * np.pi * np.arange(500) / 500.0)
    readings = sweep[:, None] + rng.normal(0.0, 0.003, (500, len(spots)))
    readings[::50, :2] = np.nan
    return lambda k: sensors.update(state, wire, readings[k % 500])


def ticks(law: Law, *, points: bool = False, task: type[PositionTask] = PositionTask) -> Callable[[int], Any]:
    """`SafetyController.step` of the IRB 140 with all 20 spots detecting, through medium and high danger and back.

    The distances sweep slowly from 0.76 m to 0.32 m and back; the path is suspended and the robot recovers. It follows
    its references exactly.

    Args:
        law: The law.
        points: Give the detected points themselves: everything but what is done to raw sensor readings.
        task: Of the position.
    """
    controller = _controller(law, task)
    assert controller.spots is not None
    robot = controller.robot
    distances, home = [d + _offsets(controller) for d in _SWEEP], robot.at(robot.home)
    given = [controller.spots.points(home, d) for d in distances] if points else distances
    state = [np.array(robot.home), np.zeros(6)]

    def tick(k: int) -> None:
        reference = (
            controller.step(state[0], state[1], points=given[k % 2500])
            if points
            else controller.step(state[0], state[1], given[k % 2500])
        ).reference
        state[:] = reference.q, reference.qd

    return tick


def batch(threads: int, farther: float = 0.0) -> Callable[[int], Any]:
    """`BatchController.step` of as many such robots, each at another place of the same sweep.

    Args:
        threads: Threads that share them.
        farther: Added to all distances [m].
    """
    controller = _controller(HierarchicalLaw(), PositionTask)
    robots, home = BatchController(controller, ROBOTS, threads), controller.robot.home
    places = np.random.default_rng(2).integers(0, len(_SWEEP), ROBOTS)
    offsets = _offsets(controller) + farther
    state = [np.tile(home, (ROBOTS, 1)), np.zeros((ROBOTS, len(home)))]

    def tick(k: int) -> None:
        told = robots.step(state[0], state[1], _SWEEP[(places + k) % len(_SWEEP)][:, None] + offsets)
        state[:] = told.q, told.qd

    return tick


_SWEEP = 0.54 + 0.22 * np.cos(2.0 * np.pi * np.arange(2500) / 2500.0)


def _controller(law: Law, task: type[PositionTask]) -> SafetyController:
    robot = load_robot("irb140")
    target = FixedPose(robot.pose("tcp", robot.home))
    return SafetyController(robot, [task("tcp", target), OrientationTask("tcp", target)], law)


def _offsets(controller: SafetyController) -> np.ndarray:
    """Of the spots' readings."""
    assert controller.spots is not None
    return np.random.default_rng(1).uniform(-0.02, 0.02, len(controller.spots))


def rows() -> dict[str, Row]:
    """All of `ROWS`, made."""
    return {name: made() for name, made in ROWS.items()}


#: What makes each row. The hierarchical law is strict where nothing else is said.
ROWS: dict[str, Callable[[], Row]] = {
    MAIN: lambda: Row(ticks(HierarchicalLaw())),
    f"{MAIN}, garbage collector on": lambda: Row(ticks(HierarchicalLaw()), "on"),
    f"{MAIN}, collector on after gc.freeze": lambda: Row(ticks(HierarchicalLaw()), "frozen"),
    "whole tick, 20 points given": lambda: Row(ticks(HierarchicalLaw(), points=True)),
    f"{MAIN}, a task of one's own": lambda: Row(ticks(HierarchicalLaw(), task=OwnTask)),
    f"{MAIN}, paper's projection": lambda: Row(ticks(HierarchicalLaw("paper"))),
    f"{MAIN}, weighted law": lambda: Row(ticks(WeightedLaw())),
    f"{MAIN}, null-space law": lambda: Row(ticks(NullspaceLaw())),
    "a robot of a batch of 1000, one core": lambda: Row(batch(1), share=ROBOTS),
    "a robot of a batch of 1000, two cores": lambda: Row(batch(2), share=ROBOTS),
    "a robot of a batch of 1000, nobody in sight, one core": lambda: Row(batch(1, np.inf), share=ROBOTS),
    ARRAYS: lambda: Row(arrays()),
    DENSE: lambda: Row(dense()),
    "danger field, 20 points x 6 links": lambda: Row(danger_field()),
    "sensing, 20 spots, all filters": lambda: Row(sensing()),
}
