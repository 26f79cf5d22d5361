"""Ticks that see by arrays instead of spots, and one dense image alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from qpsafe.controller import SafetyController
from qpsafe.danger.field import DangerField
from qpsafe.ranging.ranging import RangeSensing
from qpsafe.ranging.sensor import RangeImage, RangeSensor
from qpsafe.ranging.sensor_file import load_range_sensors
from qpsafe.robot.loader import load_robot
from qpsafe.sensing.hulls import Obstacle
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.trajectory import FixedPose

DT = 0.004
EVERY = 17  # ticks from one image of an array to the next: 15 Hz
ROWS, COLUMNS, FOCAL = 480, 640, 600.0


def arrays() -> Callable[[int], Any]:
    """`SafetyController.step` of the IRB 140 with 20 arrays of 64 zones, staggered, all of which see somebody.

    What they see fills a quarter of their zones, and sweeps as the distances of the tick with spots do, with noise.
    """
    robot, rng = load_robot("irb140"), np.random.default_rng(3)
    sensors = load_range_sensors(robot)
    target = FixedPose(robot.pose("tcp", robot.home))
    tasks = [PositionTask("tcp", target), OrientationTask("tcp", target)]
    controller = SafetyController(robot, tasks, spots="off", range_sensors=sensors)
    sweep = 0.54 + 0.22 * np.cos(2.0 * np.pi * np.arange(2500) / 2500.0)
    full = np.zeros((8, 8), dtype=bool)
    full[2:6, 2:6] = True
    images = []
    for k, distance in enumerate(sweep.tolist()):
        noisy = np.where(full.ravel(), distance + rng.normal(0.0, 0.01, (len(sensors), 64)), np.inf)
        images.append([(i, noisy[i]) for i in range(len(sensors)) if k % EVERY == i * EVERY // len(sensors)])
    state: list[Any] = [np.array(robot.home), np.zeros(6), 0]

    def tick(k: int) -> None:
        now = state[2] * DT
        came = [RangeImage(sensors[i], distances, now) for i, distances in images[k % 2500]]
        reference = controller.step(state[0], state[1], images=came, now=now).reference
        state[:] = reference.q, reference.qd, state[2] + 1

    return tick


def dense() -> Callable[[int], Any]:
    """One image of a depth camera of 640 x 480, a person before the floor, from distances to points that count."""
    robot, rng = load_robot("irb140"), np.random.default_rng(4)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], (-2.0, 0.0, 0.6)
    shape, intrinsics = (ROWS, COLUMNS), (FOCAL, FOCAL, 0.5 * COLUMNS, 0.5 * ROWS)
    camera = RangeSensor.camera("camera", shape, intrinsics, pose=pose, period=1.0 / 30.0)
    floor = Obstacle.box("floor", (6.0, 6.0, 0.1), (0.0, 0.0, -0.4))
    sensing, state, field = RangeSensing(robot, [camera], known=[floor]), robot.at(robot.home), DangerField()
    down = camera.directions.reshape(ROWS, COLUMNS, 3)[:, :, 1]
    depth = np.where(down > 0.0, 0.95 / np.maximum(down, 1e-3), np.inf)
    depth[100:420, 250:330] = 1.5
    images = [depth + rng.normal(0.0, 0.005, depth.shape) for _ in range(8)]
    where = state.q, state.body_poses(), state.wire(np.zeros(6))
    count = [0]

    def reduce(k: int) -> None:
        count[0] += 1
        now = count[0] / 30.0
        sensing.update([camera.image(images[k % 8], stamp=now)], now, *where, field)

    return reduce
