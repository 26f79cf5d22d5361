"""Distance sensors on the robot's skin: where they sit, and the points they detect, eq. (7)."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Vector, entry, inline
from qpsafe.errors import ConfigurationError
from qpsafe.sensing.skin.spot import Spot
from qpsafe.sensing.skin.spot_file import read_spots
from qpsafe.text.toml_parse import LARGEST
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import Jointed, RobotState

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpotArray:
    """The distributed distance sensor of section II-B; its arrays are its own, and read-only.

    Attributes:
        names: (k,) names.
        links: Wire link of each spot, (k,), counted from 0.
        frames: Frame in which each spot's pose is given, (k,).
        positions: Origins in those frames, (k, 3) [m].
        directions: Measuring directions in those frames, (k, 3), unit.
        range_min: Smallest distance the sensor resolves, (k,) or one number for all [m].
        range_max: Largest distance that counts as a detection, (k,) or one number [m].
        field_of_view: Full opening angle of the cone it sees, (k,) or one number [rad].
    """

    names: tuple[str, ...]
    links: NDArray[np.int64]
    frames: tuple[str, ...]
    positions: Array
    directions: Array
    range_min: Array
    range_max: Array
    field_of_view: Array = field(default_factory=lambda: np.zeros(1))

    def __post_init__(self) -> None:
        for key in ("range_min", "range_max", "field_of_view"):
            value = np.asarray(getattr(self, key), dtype=float)
            if value.shape in ((), (1,)):
                value = np.full(len(self.names), float(value.reshape(())))
            object.__setattr__(self, key, value)
        for key in ("links", "positions", "directions", "range_min", "range_max", "field_of_view"):
            own = np.array(getattr(self, key))
            own.flags.writeable = False
            object.__setattr__(self, key, own)

    def __repr__(self) -> str:
        range_max = float(self.range_max.max(initial=0.0))
        size = f"{counted(len(self), 'spot')} on {counted(len(set(self.links.tolist())), 'link')}"
        return f"SpotArray({size}, range_max={range_max:.4g})"

    def __len__(self) -> int:
        return len(self.names)

    @classmethod
    def of(cls, spots: Sequence[Spot]) -> SpotArray:
        """An array of single spots."""
        return cls(
            names=tuple(spot.name for spot in spots),
            links=np.array([spot.link for spot in spots], dtype=np.int64),
            frames=tuple(spot.frame for spot in spots),
            positions=np.array([spot.pose[:3, 3] for spot in spots], dtype=float).reshape(-1, 3),
            directions=np.array([spot.pose[:3, 2] for spot in spots], dtype=float).reshape(-1, 3),
            range_min=np.array([spot.range_min for spot in spots]),
            range_max=np.array([spot.range_max for spot in spots]),
            field_of_view=np.array([spot.field_of_view for spot in spots]),
        )

    @classmethod
    def load(cls, path: Path, robot: Robot) -> SpotArray:
        """Read and check a `spots.toml`, see `qpsafe.sensing.skin.spot_file.read_spots`.

        Args:
            path: The file.
            robot: Robot that carries the spots.

        Raises:
            RobotFileError: Names file, key and value of what is wrong.
        """
        return cls.of(read_spots(path, robot))

    def subset(self, order: Sequence[int]) -> SpotArray:
        """Some of the spots, or all in another order."""
        i = np.asarray(order, dtype=np.int64)
        return SpotArray(
            names=tuple(self.names[n] for n in i),
            links=self.links[i],
            frames=tuple(self.frames[n] for n in i),
            positions=self.positions[i],
            directions=self.directions[i],
            range_min=self.range_min[i],
            range_max=self.range_max[i],
            field_of_view=self.field_of_view[i],
        )

    def check(self, robot: Robot) -> None:
        """Whether `robot` can carry these spots.

        Raises:
            ConfigurationError: Arrays that do not fit together, numbers that are not finite, a direction that is not
                a unit vector, an unknown frame, a link the robot does not have, an empty range, an impossible cone.
        """
        k, links = len(self), len(robot.wire_frames)
        shapes = {"links": (k,), "frames": (k,), "positions": (k, 3), "directions": (k, 3)}
        shapes |= dict.fromkeys(("range_min", "range_max", "field_of_view"), (k,))
        for key, shape in shapes.items():
            if np.shape(getattr(self, key)) != shape:
                found = f"an array of shape {np.shape(getattr(self, key))}"
                raise ConfigurationError("SpotArray", key, found, f"shape {shape} for {k} names")
        for frame in self.frames:
            if frame not in robot.frame_names:
                raise ConfigurationError("SpotArray", "frames", frame, f"one of {', '.join(robot.frame_names)}")
        if self.links.dtype.kind not in "iu" or not ((self.links >= 0) & (self.links < links)).all():
            raise ConfigurationError("SpotArray", "links", self.links, f"whole numbers in 0..{links - 1}")
        if not np.isfinite(self.positions).all():
            raise ConfigurationError("SpotArray", "positions", self.positions, "finite numbers [m]")
        if not (np.abs(np.linalg.norm(self.directions, axis=1) - 1.0) <= 1e-6).all():
            raise ConfigurationError("SpotArray", "directions", self.directions, "vectors of length 1")
        if not ((self.range_min > 0.0) & (self.range_min < self.range_max) & np.isfinite(self.range_max)).all():
            found = f"{self.range_min}..{self.range_max}"
            raise ConfigurationError("SpotArray", "range_min", found, "0 < range_min < range_max, finite [m]")
        if not ((self.field_of_view >= 0.0) & (self.field_of_view <= np.pi / 2)).all():
            raise ConfigurationError("SpotArray", "field_of_view", self.field_of_view, "0 to pi/2 rad")

    def mounting(self, robot: Jointed) -> tuple[NDArray[np.int64], Array]:
        """The body of each spot (k,), and in that body's frame its origin and direction, homogeneous columns (k, 4, 2).

        Bodies are numbered as in `RobotState.body_poses`.
        """
        bodies = np.empty(len(self), dtype=np.int64)
        rays = np.zeros((len(self), 4, 2))
        for i, name in enumerate(self.frames):
            bodies[i], placement = robot.mounting(name)
            rays[i, :3, 0], rays[i, 3, 0], rays[i, :3, 1] = self.positions[i], 1.0, self.directions[i]
            rays[i] = placement @ rays[i]
        return bodies, rays

    def rays(self, state: RobotState) -> tuple[Array, Array]:
        """Origins (k, 3) [m] and unit directions (k, 3) of all spots in the world frame."""
        bodies, rays = self.mounting(state.robot)
        return rays_in_world(state.body_poses(), bodies, rays)

    def points(self, state: RobotState, distances: Array) -> Array:
        """Detected points (k, 3) in the world frame, eq. (7).

        Args:
            state: Robot at the measured joint position.
            distances: d_k, (k,) [m], finite.
        """
        return detected_points(*self.rays(state), distances)

    def detected(self, distances: Array) -> NDArray[np.bool_]:
        """Which distances (k,) are detections: those within `range_max`. +inf means nothing in sight (REP 117)."""
        return distances <= self.range_max


def rays_in_world(poses: Array, bodies: NDArray[np.int64], rays: Array) -> tuple[Array, Array]:
    """Origins and directions (k, 3) of rays that are fixed in bodies with the given poses (b, 4, 4).

    Args:
        poses: (b, 4, 4) [m].
        bodies: Which body carries each ray (k,).
        rays: Origin and direction in its axes, as homogeneous columns (k, 4, 2) [m].
    """
    origins, directions = np.empty((len(bodies), 3)), np.empty((len(bodies), 3))
    _rays(np.ascontiguousarray(poses), bodies, np.ascontiguousarray(rays), origins, directions)
    return origins, directions


@inline
def ray_of(T: Array, ray: Array) -> tuple[Vector, Vector]:
    """Origin and direction in the world of a ray, homogeneous columns (4, 2), that is fixed in a body at T (4, 4)."""
    x, y, z = ray[0, 0], ray[1, 0], ray[2, 0]
    a, b, c = ray[0, 1], ray[1, 1], ray[2, 1]
    origin = (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )
    direction = (
        T[0, 0] * a + T[0, 1] * b + T[0, 2] * c,
        T[1, 0] * a + T[1, 1] * b + T[1, 2] * c,
        T[2, 0] * a + T[2, 1] * b + T[2, 2] * c,
    )
    return origin, direction


@entry(
    types.void(
        types.Array(types.float64, 3, "C", readonly=True),
        types.Array(types.int64, 1, "A", readonly=True),
        types.Array(types.float64, 3, "C", readonly=True),
        types.float64[:, ::1],
        types.float64[:, ::1],
    )
)
def _rays(poses: Array, bodies: Array, rays: Array, origins: Array, directions: Array) -> None:
    for i in range(bodies.shape[0]):
        origin, direction = ray_of(poses[bodies[i]], rays[i])
        origins[i, 0], origins[i, 1], origins[i, 2] = origin
        directions[i, 0], directions[i, 1], directions[i, 2] = direction


def detected_points(origins: Array, directions: Array, distances: Array) -> Array:
    """Eq. (7): the point (0, 0, d_k) of the spot's frame, in the world: origin + d_k times the measuring direction.

    Args:
        origins: (k, 3) [m].
        directions: Unit vectors (k, 3).
        distances: (k,) [m].
    """
    return origins + distances[:, None] * directions


def load_spots(robot: Robot) -> SpotArray | None:
    """The robot's own spots from its `spots.toml`, or None if it has none; what has not changed is not parsed again.

    Raises:
        RobotFileError: The file is wrong, see `SpotArray.load`.
    """
    path = robot.spots_path
    if path is None:
        return None
    with suppress(OSError, ValueError), path.open("rb") as file:  # what cannot be read is told by `load`
        content = file.read(LARGEST + 1)
        if robot not in _own or _own[robot][0] != content:
            _own[robot] = content, SpotArray.load(path, robot)
        return _own[robot][1]
    return SpotArray.load(path, robot)


_own: WeakKeyDictionary[Robot, tuple[bytes, SpotArray]] = WeakKeyDictionary()
