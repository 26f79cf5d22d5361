"""What an experiment's `sensor` names: spots, arrays on the skin, a camera in the cell, or several joined by +."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.ranging.sensor_file import load_range_sensors
from qpsafe.sensing.skin.spots import SpotArray, load_spots
from qpsafe.sim.world.sensor import SENSORS

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.ranging.zones import RangingModel

Array = NDArray[np.float64]

IDEAL = "-ideal"  # ending of a kind without noise
ARRAYS, CAMERA = "vl53l5cx", "depth"
RANGING = (ARRAYS, ARRAYS + IDEAL, CAMERA, CAMERA + IDEAL)

#: The camera: behind the robot and above it, 640x480 of which every eighth pixel is simulated, like a RealSense D435.
PLACE, TARGET = (-1.5, 0.0, 1.6), (0.6, 0.0, 0.0)  # of the camera, and where it looks; from the robot's base [m]
FULL, FOCAL, STEP = (480, 640), 385.0, 8
CAMERA_RANGE = (0.2, 4.0)  # [m]
SHARP_LATE = 0.055  # a Sharp's cycle of 38 ms and its two low passes, 3 and 13 ms [s]


class SensorKinds(NamedTuple):
    """The parts of a name.

    Attributes:
        spots: One of `qpsafe.sim.world.sensor.SENSORS`; None where the robot's spots are not there.
        ranging: Of `RANGING`.
    """

    spots: str | None
    ranging: tuple[str, ...]


def sensor_kinds(name: str) -> SensorKinds:
    """The parts of what a `sensor` names, such as "sharp+depth".

    Raises:
        ConfigurationError: An unknown part, one named twice, two kinds of spots, or perfect sight and others.
    """
    parts = name.split("+") if isinstance(name, str) else []
    spots, ranging = [p for p in parts if p in SENSORS], tuple(p for p in parts if p in RANGING)
    plain = {part.removesuffix(IDEAL) for part in ranging}
    known = len(spots) + len(ranging) == len(parts) > 0
    if not (known and len(spots) <= 1 and len(plain) == len(ranging) and not (ranging and spots == ["perfect"])):
        expected = f"one of {', '.join((*SENSORS, *RANGING))}, or several joined by +, such as sharp+depth"
        raise ConfigurationError("the experiment", "sensor", name, expected)
    return SensorKinds(spots[0] if spots else None, ranging)


def range_sensors(kinds: tuple[str, ...], robot: Robot) -> tuple[list[RangeSensor], list[RangingModel]]:
    """The sensors of some kinds, and how each is simulated.

    Args:
        kinds: Of `RANGING`.
        robot: That they are on, or look at.

    Raises:
        ConfigurationError: The robot's folder has no file of arrays.
    """
    from qpsafe.sim.ranging.depth_camera_model import DepthCameraModel
    from qpsafe.sim.ranging.vl53l5cx_model import Vl53l5cxModel
    from qpsafe.sim.ranging.zones import Ideal

    sensors: list[RangeSensor] = []
    models: list[RangingModel] = []
    for kind in kinds:
        arrays = kind.removesuffix(IDEAL) == ARRAYS
        found = load_range_sensors(robot, ARRAYS) if arrays else [overhead_camera()]
        real: RangingModel = Vl53l5cxModel() if arrays else DepthCameraModel()
        sensors += found
        models += [Ideal(cones=arrays) if kind.endswith(IDEAL) else real] * len(found)
    return sensors, models


def delay(sensor: str, robot: Robot) -> float:
    """How late sensors tell what is there, at most [s].

    Args:
        sensor: See `sensor_kinds`.
        robot: The robot.
    """
    kinds = sensor_kinds(sensor)
    sensors, models = range_sensors(kinds.ranging, robot)
    images = (model.latency + sensor.period for sensor, model in zip(sensors, models, strict=True))
    return max(images, default=SHARP_LATE if kinds.spots == "sharp" else 0.0)


def overhead_camera(name: str = "overhead camera") -> RangeSensor:
    """The depth camera of the experiments, with every eighth pixel of every eighth row."""
    z = np.subtract(TARGET, PLACE) / np.linalg.norm(np.subtract(TARGET, PLACE))
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, np.cross(z, x), z, PLACE
    rows, columns = FULL[0] // STEP, FULL[1] // STEP
    intrinsics = (FOCAL / STEP, FOCAL / STEP, 0.5 * (columns - 1), 0.5 * (rows - 1))
    least, most = CAMERA_RANGE
    return RangeSensor.camera(
        name, (rows, columns), intrinsics, pose=pose, range_min=least, range_max=most, period=1.0 / 30.0,
        sigma=0.02, covers=False, max_age=0.15,  # its latency, and an image that is lost
    )  # fmt: skip


def lines_of_sight(name: str, robot: Robot) -> SpotArray:
    """For pictures: the rays of the spots, or of the arrays that are there in their place, one each.

    Args:
        name: The experiment's `sensor`.
        robot: The robot.
    """
    kinds = sensor_kinds(name)
    if kinds.spots is not None:
        spots = load_spots(robot)
        assert spots is not None
        return spots
    sensors, _ = range_sensors(kinds.ranging, robot)
    on_skin = [sensor for sensor in sensors if sensor.mount in robot.frame_names]
    return SpotArray(
        names=tuple(sensor.name for sensor in on_skin),
        links=np.zeros(len(on_skin), dtype=np.int64),
        frames=tuple(sensor.mount for sensor in on_skin),
        positions=np.array([sensor.pose[:3, 3] for sensor in on_skin]).reshape(-1, 3),
        directions=np.array([sensor.pose[:3, 2] for sensor in on_skin]).reshape(-1, 3),
        range_min=np.array([sensor.range_min for sensor in on_skin]),
        range_max=np.array([sensor.range_max for sensor in on_skin]),
    )
