"""What a sensor of many zones is: where it sits, where its zones look, how far and how often; and its images."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.given import is_number, parts_of, rows_and_columns
from qpsafe.text.given import numbers

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.skin.spot import Spot

Array = NDArray[np.float64]

LEAST_INCREMENT = 1e-5  # between rays of a scanner [rad]
WORLD = "world"


@dataclass(frozen=True, eq=False)
class RangeSensor:
    """A sensor that tells the distance of what is nearest in each of its zones; its arrays are its own, and read-only.

    A zone is a cone around a unit direction. Depth cameras, planar scanners, time-of-flight arrays and single spots
    differ in their zones only.

    Attributes:
        name: Of its own; images and reports are told apart by it.
        directions: Of the zones, in the sensor's frame, whose z axis is its line of sight, (z, 3), unit.
        half_angle: Half the opening angle of each zone's cone, (z,) or one number [rad].
        mount: The frame that it is fixed to: one of the robot's, or "world", the robot's base.
        pose: From that frame to the sensor's, (4, 4) [m].
        range_min: What reads nearer counts as danger, whatever it is; the sensor resolves nothing there [m].
        range_max: What is farther does not count [m].
        period: From one image to the next [s].
        sigma: Standard deviation of a reading where the image does not tell [m].
        link: Wire link that its points act on, counted from 0; None: each point on the link nearest to it.
        shape: Rows and columns of the zones; (1, z) where they have no order.
        covers: Whether a zone that reads "nothing" says that its cone is free up to `range_max`.
        max_age: An image that is older is stale, and a sensor without a newer one is silent [s]; three periods where
            it is None, see `patience`.

    Raises:
        ConfigurationError: Names the attribute that is wrong.
    """

    name: str
    directions: Array
    half_angle: Array
    mount: str = WORLD
    pose: Array = field(default_factory=lambda: np.eye(4))
    range_min: float = 0.02
    range_max: float = 4.0
    period: float = 1.0 / 15.0
    sigma: float = 0.01
    link: int | None = None
    shape: tuple[int, int] = (0, 0)
    covers: bool = True
    max_age: float | None = None

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name):
            self._refuse("name", self.name, "a name")
        directions = self._numbers("directions", (-1, 3))
        count = len(directions)
        if not (count and np.abs(np.linalg.norm(directions, axis=1) - 1.0).max() <= 1e-6):
            self._refuse("directions", f"an array of shape {directions.shape}", "at least one unit vector (z, 3)")
        half_angle = self._numbers("half_angle", None)
        if half_angle.size not in (1, count) or not ((half_angle >= 0.0) & (half_angle < 0.25 * np.pi)).all():
            self._refuse("half_angle", self.half_angle, f"an angle from 0 to 45 degrees [rad], one or {count}")
        pose = self._numbers("pose", (4, 4))
        R = pose[:3, :3]
        if not (np.abs(R @ R.T - np.eye(3)).max() <= 1e-6 and np.linalg.det(R) > 0.0):
            self._refuse("pose", self.pose, "a pose (4, 4): a rotation and a place")
        if not np.array_equal(pose[3], (0.0, 0.0, 0.0, 1.0)):
            self._refuse("pose", self.pose, "a last row of 0 0 0 1")
        own = {"directions": directions, "half_angle": np.broadcast_to(half_angle.ravel(), (count,)), "pose": pose}
        for key, value in own.items():
            array = np.array(value)
            array.flags.writeable = False
            object.__setattr__(self, key, array)
        for key, least in (("range_min", 0.0), ("sigma", 0.0), ("period", 1e-4)):
            value = getattr(self, key)
            if not (is_number(value) and least <= value < 1e3):
                self._refuse(key, value, f"a number >= {least:g}")
        if not isinstance(self.covers, bool):
            self._refuse("covers", self.covers, "True or False")
        if not (is_number(self.range_max) and self.range_min < self.range_max < 1e3):
            self._refuse("range_max", self.range_max, f"a distance > range_min = {self.range_min} [m]")
        if self.max_age is not None and not (is_number(self.max_age) and self.max_age > 0.0):
            self._refuse("max_age", self.max_age, "a time > 0 [s]")
        shape = rows_and_columns(self.shape)
        shape = (1, count) if shape == (0, 0) else shape
        if shape is None or min(shape) < 1 or shape[0] * shape[1] != count:
            self._refuse("shape", self.shape, f"rows and columns of {count} zones")
        object.__setattr__(self, "shape", shape)

    def __setstate__(self, state: dict[str, object]) -> None:
        """Unpickled and copied arrays can be written to again."""
        self.__dict__.update(state)
        for array in (self.directions, self.half_angle, self.pose):
            array.flags.writeable = False

    @property
    def patience(self) -> float:
        """How old an image may be [s]: `max_age`, or three periods."""
        return 3.0 * self.period if self.max_age is None else self.max_age

    def __len__(self) -> int:
        return len(self.directions)

    def __repr__(self) -> str:
        return f"RangeSensor({self.name!r}, zones={self.shape}, mount={self.mount!r}, range_max={self.range_max:.4g})"

    @classmethod
    def array(
        cls, name: str, rows: int = 8, columns: int = 8, field_of_view: float = np.pi / 4, **parts: object
    ) -> RangeSensor:
        """A time-of-flight array: square zones of equal angles, the first row at the top (-y), x to the right.

        Args:
            name: Of its own.
            rows: Of zones.
            columns: Of zones.
            field_of_view: From edge to edge along rows and columns, not along the diagonal [rad].
            parts: Other attributes.
        """
        whole, where = rows_and_columns((rows, columns)), f"RangeSensor {name!r}"
        if whole is None or min(whole) < 1:
            raise ConfigurationError(where, "rows, columns", (rows, columns), "whole numbers >= 1")
        if not (is_number(field_of_view) and 0.0 < field_of_view < np.pi):
            raise ConfigurationError(where, "field_of_view", field_of_view, "an angle > 0, below 180 degrees [rad]")
        (rows, columns), pitch = whole, field_of_view / max(whole)
        across = np.tan(pitch * (np.arange(columns) - 0.5 * (columns - 1)))
        down = np.tan(pitch * (np.arange(rows) - 0.5 * (rows - 1)))
        y, x = np.meshgrid(down, across, indexing="ij")
        # a cone of this half angle holds the square zone up to its corners
        return cls(
            name, _units(np.stack((x, y, np.ones_like(x)), axis=-1)), np.asarray(np.sqrt(0.5) * pitch),
            shape=(rows, columns), **parts,  # type: ignore[arg-type]
        )  # fmt: skip

    @classmethod
    def camera(
        cls, name: str, shape: tuple[int, int], intrinsics: tuple[float, float, float, float], **parts: object
    ) -> RangeSensor:
        """A depth camera without distortion, z ahead, x to the right, y down.

        Args:
            name: Of its own.
            shape: Rows and columns.
            intrinsics: fx, fy, cx, cy [pixels].
            parts: Other attributes.
        """
        whole, where = rows_and_columns(shape), f"RangeSensor {name!r}"
        if whole is None or min(whole) < 1:
            raise ConfigurationError(where, "shape", shape, "rows and columns, whole numbers >= 1")
        optics = parts_of(intrinsics)
        if not (len(optics) == 4 and all(map(is_number, optics)) and min(optics[:2]) > 0.0):
            raise ConfigurationError(where, "intrinsics", intrinsics, "fx, fy > 0 and cx, cy [pixels]")
        shape, (fx, fy, cx, cy) = whole, optics
        v, u = np.meshgrid(np.arange(shape[0], dtype=float), np.arange(shape[1], dtype=float), indexing="ij")
        directions = _units(np.stack(((u - cx) / fx, (v - cy) / fy, np.ones_like(u)), axis=-1))
        half = np.arctan(np.sqrt(0.5) / min(fx, fy))
        return cls(name, directions, np.asarray(half), shape=shape, **parts)  # type: ignore[arg-type]

    @classmethod
    def planar(cls, name: str, angle_min: float, increment: float, count: int, **parts: object) -> RangeSensor:
        """A planar scanner: rays in the x-y plane of its frame, as in a ROS LaserScan (x ahead, z up).

        Args:
            name: Of its own.
            angle_min: Of the first ray, from the x axis [rad].
            increment: From ray to ray [rad].
            count: Of rays.
            parts: Other attributes.
        """
        where = f"RangeSensor {name!r}"
        for key, angle in (("angle_min", angle_min), ("increment", increment)):
            if not is_number(angle):
                raise ConfigurationError(where, key, angle, "an angle [rad]")
        whole = rows_and_columns((1, count))
        if whole is None or count < 1:
            raise ConfigurationError(where, "count", count, "a whole number of rays >= 1")
        if count > 1 and abs(increment) < LEAST_INCREMENT:
            raise ConfigurationError(where, "increment", increment, f"at least {LEAST_INCREMENT} rad: rays that differ")
        angles = angle_min + increment * np.arange(whole[1])
        directions = np.stack((np.cos(angles), np.sin(angles), np.zeros(whole[1])), axis=-1)
        return cls(name, directions, np.asarray(0.5 * abs(increment)), **parts)  # type: ignore[arg-type]

    @classmethod
    def of_spot(cls, spot: Spot, period: float = 0.004) -> RangeSensor:
        """A spot as a sensor of one zone; its points act on the link that carries it, as in eq. (8).

        Args:
            spot: The spot.
            period: From one reading to the next [s].
        """
        return cls(
            spot.name, np.array([[0.0, 0.0, 1.0]]), np.asarray(0.5 * spot.field_of_view), mount=spot.frame,
            pose=spot.pose, range_min=spot.range_min, range_max=spot.range_max, period=period, sigma=0.0,
            link=spot.link, covers=True,
        )  # fmt: skip

    def image(
        self, distances: ArrayLike, *, stamp: float, valid: ArrayLike | None = None, sigma: ArrayLike | None = None
    ) -> RangeImage:
        """An image of this sensor, see `RangeImage`.

        Args:
            distances: Along the zones' directions, (z,) or `shape` [m].
            stamp: When it was taken [s].
            valid: Which zones tell anything, likewise; those that are not NaN by default.
            sigma: Standard deviations, likewise or one number [m].
        """

        return RangeImage(self, distances, stamp, valid, sigma)

    def placed(self, pose: ArrayLike, mount: str | None = None) -> RangeSensor:
        """The same sensor elsewhere.

        Args:
            pose: From `mount` to the sensor's frame (4, 4) [m].
            mount: Frame; the present one by default.
        """
        mount = self.mount if mount is None else mount
        return replace(self, pose=pose, mount=mount)  # type: ignore[arg-type]  # made an array there, or refused

    def same_zones(self, other: RangeSensor) -> bool:
        """Whether another sensor looks along the same directions with the same cones."""
        return self is other or (
            self.shape == other.shape
            and np.allclose(self.directions, other.directions, atol=1e-9, rtol=0.0)
            and np.allclose(self.half_angle, other.half_angle, atol=1e-9, rtol=0.0)
        )

    def same_place(self, other: RangeSensor) -> bool:
        """Whether another sensor is fixed where this one is."""
        return self is other or (self.mount == other.mount and np.allclose(self.pose, other.pose, atol=1e-9, rtol=0.0))

    def check(self, robot: Robot) -> None:
        """Whether a robot's cell can hold this sensor.

        Raises:
            ConfigurationError: An unknown frame, or a link that the robot does not have.
        """
        if self.mount != WORLD and self.mount not in robot.frame_names:
            self._refuse("mount", self.mount, "world, or one of " + ", ".join(robot.frame_names))
        links = len(robot.wire_frames)
        whole = isinstance(self.link, int) and not isinstance(self.link, bool)
        if self.link is not None and not (whole and 0 <= self.link < links):
            self._refuse("link", self.link, f"None, or a wire link from 0 to {links - 1}")

    def _numbers(self, key: str, shape: tuple[int, ...] | None) -> Array:
        value = getattr(self, key)
        array = numbers(f"RangeSensor {self.name!r}", key, value, "real numbers, none of them masked")
        if not np.isfinite(array).all():
            self._refuse(key, value, "finite numbers")
        try:
            return array if shape is None else array.reshape(shape)
        except ValueError:
            self._refuse(key, value, f"numbers of shape {shape}")

    def _refuse(self, key: str, value: object, expected: str) -> NoReturn:
        raise ConfigurationError(f"RangeSensor {self.name!r}", key, value, expected)


class RangeImage(NamedTuple):
    """What a sensor of many zones saw at one moment: the one input of everything that ranges.

    It is data: nothing is checked when it is made. `SafetyController.step(images=...)` judges it, and reports what it
    cannot use.

    Attributes:
        sensor: Which one: its zones, where it is fixed, how far it looks.
        distances: Of what is nearest in each zone, along the zone's direction, (z,) or `sensor.shape` [m]. Beyond the
            sensor's range, +inf included, nothing is in sight (REP 117); NaN where the sensor cannot tell.
        stamp: When it was taken, by the clock of `step(now=...)` [s].
        valid: Which zones tell anything, likewise; None: those that are not NaN.
        sigma: Standard deviation of each distance, likewise or one number [m]; None: the sensor's.
    """

    sensor: RangeSensor
    distances: ArrayLike
    stamp: float
    valid: ArrayLike | None = None
    sigma: ArrayLike | None = None


def _units(v: Array) -> Array:
    v = v.reshape(-1, 3)
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))
