"""Where people are over time, as capsules and boards in flat arrays: one row a tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.people.person import SEGMENTS, Person, PersonPose

if TYPE_CHECKING:
    from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PersonTracks:
    """The capsules and boards of all people of a trial, T ticks; world frame. Its arrays are read-only.

    Attributes:
        ends: The two end points of every capsule's axis, person by person, (T, S, 2, 3) with S = 17 p [m].
        radii: Of the capsules, (S,) [m].
        boards: Poses of the boards' boxes, (T, B, 4, 4) [m].
        half_sizes: Of the boards, (B, 3) [m].
        dt: Time of a tick [s].
        names: Region of the body that each capsule belongs to, without its side, (S,).
        balls: A ball (centre, radius) around the capsules of each person, (T, p, 4) [m]; computed.

    Raises:
        ConfigurationError: Shapes that do not fit together, or numbers that are not finite.
    """

    ends: Array
    radii: Array
    boards: Array
    half_sizes: Array
    dt: float
    names: tuple[str, ...]
    balls: Array = field(init=False)

    def __post_init__(self) -> None:
        ticks, s, b = len(self.ends), len(self.radii), len(self.half_sizes)
        shapes = {"ends": (ticks, s, 2, 3), "radii": (s,), "boards": (ticks, b, 4, 4), "half_sizes": (b, 3)}
        for key, shape in shapes.items():
            own = np.array(getattr(self, key), dtype=np.float64, order="C")
            if own.shape != shape or not np.isfinite(own).all():
                raise ConfigurationError("PersonTracks", key, f"an array of shape {own.shape}", f"finite, {shape}")
            object.__setattr__(self, key, own)
        if len(self.names) != s or s % len(SEGMENTS):
            raise ConfigurationError("PersonTracks", "names", self.names, f"one a capsule, {len(SEGMENTS)} a person")
        object.__setattr__(self, "balls", _balls(self.ends, self.radii))
        for key in (*shapes, "balls"):
            getattr(self, key).flags.writeable = False

    @classmethod
    def of(cls, people: Sequence[Person], poses: Sequence[Sequence[PersonPose]], dt: float) -> PersonTracks:
        """Tracks of people whose poses have been computed one by one.

        Args:
            people: Who is there.
            poses: Everybody's pose, in the order of `people`, at every tick.
            dt: Time of a tick [s].
        """
        segments = [segment for person in people for segment in person.body.segments]
        boards = [person.board for person in people if person.board is not None]
        return cls(
            _of_length(
                np.array([[pose.ends for pose in row] for row in poses]).reshape(len(poses), len(segments), 2, 3),
                np.array([segment.length for segment in segments]),
            ),
            np.array([segment.radius for segment in segments]),
            np.array([[_board(pose) for pose in row if pose.board_position is not None] for row in poses]).reshape(
                len(poses), len(boards), 4, 4
            ),
            np.array([(0.5 * b.thickness, 0.5 * b.width, 0.5 * b.height) for b in boards]).reshape(-1, 3),
            dt,
            tuple(segment.name.removeprefix("left_").removeprefix("right_") for segment in segments),
        )

    def row(self, tick: int) -> tuple[Array, Array, Array, Array, Array]:
        """What compiled code is given of one tick: ends, radii, balls, boards, half sizes."""
        return self.ends[tick], self.radii, self.balls[tick], self.boards[tick], self.half_sizes

    def __len__(self) -> int:
        return len(self.ends)


def _of_length(ends: Array, lengths: Array) -> Array:
    """Ends (T, S, 2, 3) around the same middles in the same directions, but of the segments' lengths (S,) [m].

    A hand that a pose stretches, by millimetres, is a capsule of its own length in MuJoCo's scene: so it is here.
    """
    middles, axes = 0.5 * (ends[:, :, 0] + ends[:, :, 1]), ends[:, :, 1] - ends[:, :, 0]
    offsets = (0.5 * lengths / np.sqrt((axes * axes).sum(axis=2)))[:, :, None] * axes
    return np.stack((middles - offsets, middles + offsets), axis=2)


def people_of(scene: Scene, data: Any) -> tuple[Array, Array, Array, Array, Array]:
    """People and boards as MuJoCo has them now, geom poses up to date: the same as a row of `PersonTracks`."""
    model, geoms, boards = scene.model, scene.person_geoms, scene.board_geoms
    radii, halves = model.geom_size[geoms, 0], model.geom_size[geoms, 1]
    offsets = halves[:, None] * data.geom_xmat[geoms][:, 2::3]  # along the third axis
    places, ends = data.geom_xpos[geoms], np.empty((len(geoms), 2, 3))
    ends[:, 0], ends[:, 1] = places - offsets, places + offsets
    poses = np.zeros((len(boards), 4, 4))
    poses[:, :3, :3], poses[:, :3, 3], poses[:, 3, 3] = (
        data.geom_xmat[boards].reshape(-1, 3, 3),
        data.geom_xpos[boards],
        1,
    )
    return ends, radii, _balls(ends[None], radii)[0], poses, model.geom_size[boards]


def _balls(ends: Array, radii: Array) -> Array:
    """Balls around the capsules of each person, (T, p, 4) [m]."""
    parts = ends.reshape(len(ends), -1, 2 * len(SEGMENTS), 3)
    centres = 0.5 * (parts.min(axis=2) + parts.max(axis=2))
    offsets = parts - centres[:, :, None]
    away = np.sqrt((offsets * offsets).sum(axis=3)) + radii.repeat(2).reshape(-1, 2 * len(SEGMENTS))
    return np.concatenate((centres, away.max(axis=2)[:, :, None]), axis=2)


def _board(pose: Any) -> Array:
    """Pose (4, 4) of a board."""
    w, x, y, z = pose.board_quaternion
    T = np.eye(4)
    T[:3, :3] = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    T[:3, 3] = pose.board_position
    return T
