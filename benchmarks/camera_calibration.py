"""How well `qpsafe calibrate-camera` finds simulated cameras: anywhere around the robot, without any guess.

    python benchmarks/camera_calibration.py --robots irb140 iiwa14 --seeds 10     # some 5 s each

The camera is a coarse one, 80 x 60 pixels, with the noise of a stereo camera; the robot stands at random postures. The
images come from the simulation's own rays against the geometry that is also the target: what a real robot's covers and
cables add is not in them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import qpsafe
from qpsafe.ranging.cell_cameras import looking
from qpsafe.ranging.extrinsics.calibrate import CameraCalibration, calibrate_camera
from qpsafe.ranging.extrinsics.recording import Recording
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sim.engine.spot_rays import SpotReader
from qpsafe.sim.engine.world import World
from qpsafe.sim.ranging.zones import zone_table
from qpsafe.sim.world.scene import build_scene
from qpsafe.text.json_text import json_text

Array = np.ndarray[Any, np.dtype[np.float64]]
NOBODY = (np.zeros((0, 2, 3)), np.zeros(0), np.zeros((0, 4)), np.zeros((0, 4, 4)), np.zeros((0, 3)))


@dataclass
class Studio:
    """A robot on its pedestal, and cameras anywhere."""

    robot: Any
    scene: Any
    world: Any

    @classmethod
    def of(cls, name: str) -> Studio:
        """With a robot."""
        robot = qpsafe.load_robot(name)
        scene = build_scene(robot)
        return cls(robot, scene, World.of(scene))

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
        people: Callable[[int], tuple[Array, ...]] = lambda image: NOBODY,
        sigma_1m: float = 0.004,
    ) -> Recording:
        """Images at random configurations around the robot's home posture; noise grows with the square."""
        robot = self.robot
        reader = SpotReader(self.world, zone_table(self.scene, sensor, sensor.range_max, cones=False))
        q = np.clip(robot.home + rng.uniform(-0.8, 0.8, (images, robot.nq)), robot.lower, robot.upper)
        d = np.array([reader.read(self.world.poses(robot.at(row)), people(k))[0] for k, row in enumerate(q)])
        seen = np.isfinite(d)
        d[seen] += sigma_1m * d[seen] ** 2 * rng.normal(size=int(seen.sum()))
        return Recording(sensor, q, d)


def somebody(image: int) -> tuple[Array, ...]:
    """A person of 1.2 m who walks around the robot, another place in every image."""
    x, y = 1.1 * np.cos(0.7 * image), 1.1 * np.sin(0.7 * image)
    ends, balls = np.array([[[x, y, 0.0], [x, y, 1.2]]]), np.array([[x, y, 0.6, 1.0]])
    return ends, np.array([0.15]), balls, np.zeros((0, 4, 4)), np.zeros((0, 3))


def errors(found: CameraCalibration, true: Array) -> tuple[float, float, float]:
    """How far the camera is from where it should be [mm], how far it is turned [deg], and how far a place in the
    middle of what it saw is from where it is then said to be [mm].
    """  # fmt: skip
    turned = found.pose[:3, :3].T @ true[:3, :3]
    angle = np.rad2deg(np.arccos(np.clip(0.5 * (np.trace(turned) - 1.0), -1.0, 1.0)))
    middle = np.append(found.centre, 1.0)
    off = (found.pose @ np.linalg.inv(true) @ middle - middle)[:3]
    return float(1e3 * np.linalg.norm(found.pose[:3, 3] - true[:3, 3])), float(angle), float(1e3 * np.linalg.norm(off))


def main() -> None:
    """Run, print a line each, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=["irb140", "iiwa14", "irb14000"])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--images", type=int, default=24)
    parser.add_argument("--person", action="store_true", help="somebody walks through the images")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    rows = {}
    for name in asked.robots:
        studio = Studio.of(name)
        rows[name] = []
        for seed in range(asked.seeds):
            rng = np.random.default_rng(seed)
            sensor = studio.camera(rng)
            recording = studio.record(sensor, rng, asked.images, somebody if asked.person else lambda image: NOBODY)
            used = time.process_time()
            found = calibrate_camera(studio.robot, recording)
            used = time.process_time() - used
            place, angle, middle = errors(found, sensor.pose)
            told = "; ".join(found.weak) or "good"
            print(f"{name} {seed}: {place:.1f} mm, {angle:.2f} deg, {middle:.1f} mm, {used:.1f} s: {told}", flush=True)
            rows[name].append({
                "place": place, "angle": angle, "middle": middle, "good": not found.weak, "rms": 1e3 * found.rms,
                "deviation": 1e3 * found.deviation[0], "seconds": used,
            })  # fmt: skip
    if asked.out is not None:
        asked.out.write_text(json_text({"images": asked.images, "robots": rows}) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
