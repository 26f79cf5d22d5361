"""Recordings of a simulated robot before a simulated camera whose pose is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.ranging.cell_cameras import looking
from qpsafe.ranging.extrinsics.recording import Recording
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sim.engine.spot_rays import SpotReader
from qpsafe.sim.engine.world import World
from qpsafe.sim.ranging.zones import zone_table
from qpsafe.sim.world.scene import build_scene

NOBODY = (np.zeros((0, 2, 3)), np.zeros(0), np.zeros((0, 4)), np.zeros((0, 4, 4)), np.zeros((0, 3)))


@dataclass
class Studio:
    """A robot on its pedestal, and cameras anywhere."""

    robot: Any
    scene: Any
    world: Any

    def camera(self, rng: np.random.Generator, shape: tuple[int, int] = (60, 80)) -> RangeSensor:
        """A coarse depth camera of 70 degrees, 1.4 to 2.4 m from the robot's axis, anywhere around, upright."""
        around, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(1.4, 2.4)
        place = [away * np.cos(around), away * np.sin(around), rng.uniform(0.5, 2.0)]
        pose = looking(place, rng.uniform([-0.2, -0.3, 0.3], [0.4, 0.3, 0.7]))
        f = 0.5 * shape[1] / np.tan(np.deg2rad(35.0))
        intrinsics = (f, f, 0.5 * (shape[1] - 1), 0.5 * (shape[0] - 1))
        return RangeSensor.camera("wall", shape, intrinsics, pose=pose, range_max=6.0)

    def record(
        self,
        sensor: RangeSensor,
        rng: np.random.Generator,
        images: int = 20,
        people: Callable[[int], tuple[np.ndarray, ...]] = lambda image: NOBODY,
        sigma_1m: float = 0.004,
    ) -> Recording:
        """Images at random configurations around the robot's home posture; noise grows with the square."""
        robot = self.robot
        reader = SpotReader(self.world, zone_table(self.scene, sensor, sensor.range_max, cones=False))
        q = np.clip(robot.home + rng.uniform(-0.8, 0.8, (images, robot.nq)), robot.lower, robot.upper)
        read = [reader.read(self.world.poses(robot.at(row)), people(k))[0].copy() for k, row in enumerate(q)]
        d = np.array(read)
        seen = np.isfinite(d)
        d[seen] += sigma_1m * d[seen] ** 2 * rng.normal(size=int(seen.sum()))
        return Recording(sensor, q, d)


def error(found: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Of a pose: how far the camera is from where it should be [mm], and how far it is turned [deg]."""
    turned = found[:3, :3].T @ true[:3, :3]
    angle = np.rad2deg(np.arccos(np.clip(0.5 * (np.trace(turned) - 1.0), -1.0, 1.0)))
    return float(1e3 * np.linalg.norm(found[:3, 3] - true[:3, 3])), float(angle)


@pytest.fixture(scope="session")
def studio() -> Studio:
    robot = qpsafe.load_robot("irb140")
    scene = build_scene(robot)
    return Studio(robot, scene, World.of(scene))


@pytest.fixture(scope="session")
def pose_error() -> Any:
    return error
