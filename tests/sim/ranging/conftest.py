"""Random encounters, those of the engine's tests, and sensors of every kind."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.ranging.adapters.vl53l5cx import vl53l5cx
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sim.engine.world import World
from qpsafe.sim.world.scene import build_scene


@pytest.fixture(scope="session")
def worlds() -> Any:
    """The module `random_worlds`."""
    path = Path(__file__).parents[1] / "engine" / "random_worlds.py"
    spec = importlib.util.spec_from_file_location("random_worlds", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def stage(worlds: Any) -> Any:
    """Robot, scene with two people, flat world."""
    robot = qpsafe.load_robot("irb140")
    scene = build_scene(robot, people=worlds.PEOPLE)
    return robot, scene, World.of(scene)


def looking(position: tuple[float, ...], at: tuple[float, ...]) -> np.ndarray:
    """A pose whose z axis points somewhere, its x axis level."""
    z = np.subtract(at, position)
    z = z / np.linalg.norm(z)
    x = np.cross([0.0, 0.0, -1.0], z)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, np.cross(z, x), z, position
    return pose


@pytest.fixture(scope="session")
def kinds() -> list[RangeSensor]:
    """An array on the elbow, one on the tool, a camera on the wall, a scanner at the pedestal."""
    out = np.eye(4)
    out[:3, 3] = 0.0, 0.0, 0.05
    aside = looking((0.0, 0.0, 0.0), (1.0, 0.3, 0.2))
    level = np.eye(4)
    level[:3, 3] = 0.3, 0.0, -0.3
    intrinsics = (20.0, 20.0, 15.5, 11.5)
    return [
        vl53l5cx("elbow", mount="dh3", pose=aside),
        vl53l5cx("tool", zones=4, mount="tcp", pose=out),
        RangeSensor.camera(
            "wall", (24, 32), intrinsics, pose=looking((2.5, 0.4, 1.2), (0.0, 0.0, 0.0)), period=1 / 30, range_max=5.0
        ),
        RangeSensor.planar("feet", -2.0, 0.05, 81, pose=level, period=0.04, range_max=5.0),
    ]
