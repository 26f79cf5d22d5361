"""Distance sensors on the robot's skin: where they sit, and the points they detect, eq. (7)."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qpsafe.errors import ConfigurationError, RobotFileError

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState

_Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Positive = Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=False)]
_Vector = tuple[_Finite, _Finite, _Finite]


class Spot(BaseModel):
    """One distance sensor.

    Attributes:
        name: Shown in reports.
        link: Wire link (1 = first) that carries it; its danger vector acts on this link, eq. (8).
        frame: Frame of that link in which the pose is given, e.g. ``dh3``.
        position: Origin of the spot in `frame` [m].
        direction: Measuring direction in `frame`, unit vector: the spot's z axis in eq. (7).
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: str
    link: Annotated[int, Field(strict=True, ge=1)]
    frame: str
    position: _Vector
    direction: _Vector


class SpotFile(BaseModel):
    """Contents of a `spots.toml`: the sensor's range [m] and the spots."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    sensor: str
    range_min: _Positive
    range_max: _Positive
    spot: list[Spot]


@dataclass(frozen=True)
class SpotArray:
    """The distributed distance sensor of section II-B.

    Attributes:
        names: (k,) names.
        links: Wire link of each spot, (k,), counted from 0.
        frames: Frame in which each spot's pose is given, (k,).
        positions: Origins in those frames, (k, 3) [m].
        directions: Measuring directions in those frames, (k, 3), unit.
        range_min: Smallest distance the sensor resolves [m].
        range_max: Largest distance that counts as a detection [m].
    """

    names: tuple[str, ...]
    links: NDArray[np.int64]
    frames: tuple[str, ...]
    positions: NDArray[np.float64]
    directions: NDArray[np.float64]
    range_min: float
    range_max: float

    def __len__(self) -> int:
        return len(self.names)

    @classmethod
    def load(cls, path: Path, robot: Robot) -> SpotArray:
        """Read and check a `spots.toml`.

        Args:
            path: The file.
            robot: Robot that carries the spots.

        Raises:
            RobotFileError: Names file, key and value of what is wrong: malformed TOML, an unknown frame, a link the
                robot does not have, a direction that is not a unit vector, an empty range.
        """
        try:
            content = SpotFile.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
        except OSError as error:
            raise RobotFileError(path, "file", str(path), f"a readable file ({error.strerror})") from None
        except tomllib.TOMLDecodeError as error:
            raise RobotFileError(path, "file", str(path), f"valid TOML ({error})") from None
        except UnicodeDecodeError as error:
            raise RobotFileError(path, "file", str(path), f"text in UTF-8 ({error})") from None
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(str(part) for part in first["loc"])
            raise RobotFileError(path, key, first.get("input"), first["msg"]) from None
        if not content.range_min < content.range_max:
            raise RobotFileError(path, "range_min", content.range_min, f"less than range_max = {content.range_max}")
        for i, spot in enumerate(content.spot):
            key = f"spot[{i}] ({spot.name})"
            if spot.frame not in robot.frame_names:
                raise RobotFileError(path, f"{key}.frame", spot.frame, f"one of {', '.join(robot.frame_names)}")
            if spot.link > len(robot.wire_frames):
                raise RobotFileError(path, f"{key}.link", spot.link, f"a link in 1..{len(robot.wire_frames)}")
            if abs(float(np.linalg.norm(spot.direction)) - 1.0) > 1e-6:
                raise RobotFileError(path, f"{key}.direction", spot.direction, "a vector of length 1")
        return cls(
            names=tuple(spot.name for spot in content.spot),
            links=np.array([spot.link - 1 for spot in content.spot], dtype=np.int64),
            frames=tuple(spot.frame for spot in content.spot),
            positions=np.array([spot.position for spot in content.spot], dtype=float).reshape(-1, 3),
            directions=np.array([spot.direction for spot in content.spot], dtype=float).reshape(-1, 3),
            range_min=content.range_min,
            range_max=content.range_max,
        )

    def check(self, robot: Robot) -> None:
        """Whether `robot` can carry these spots.

        Raises:
            ConfigurationError: Arrays that do not fit together, numbers that are not finite, a direction that is not
                a unit vector, an unknown frame, a link the robot does not have, an empty range.
        """
        k, links = len(self), len(robot.wire_frames)
        for key, shape in (("links", (k,)), ("frames", (k,)), ("positions", (k, 3)), ("directions", (k, 3))):
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
        if not 0.0 < self.range_min < self.range_max < np.inf:
            found = f"{self.range_min}..{self.range_max}"
            raise ConfigurationError("SpotArray", "range_min", found, "0 < range_min < range_max, finite [m]")

    def rays(self, state: RobotState) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origins (k, 3) [m] and unit directions (k, 3) of all spots in the world frame."""
        origins, directions = np.empty_like(self.positions), np.empty_like(self.directions)
        for frame in dict.fromkeys(self.frames):
            here = np.array([other == frame for other in self.frames])
            pose = state.pose(frame)
            origins[here] = self.positions[here] @ pose[:3, :3].T + pose[:3, 3]
            directions[here] = self.directions[here] @ pose[:3, :3].T
        return origins, directions

    def points(self, state: RobotState, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Detected points (k, 3) in the world frame, eq. (7): origin + d_k times the measuring direction.

        Args:
            state: Robot at the measured joint position.
            distances: d_k, (k,) [m], finite.
        """
        origins, directions = self.rays(state)
        return origins + distances[:, None] * directions

    def detected(self, distances: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which distances (k,) are detections: those within `range_max`. +inf means nothing in sight (REP 117)."""
        return distances <= self.range_max


def load_spots(robot: Robot) -> SpotArray | None:
    """The robot's own spots from its `spots.toml`, or None if it has none.

    Raises:
        RobotFileError: The file is wrong, see `SpotArray.load`.
    """
    return None if robot.spots_path is None else SpotArray.load(robot.spots_path, robot)
