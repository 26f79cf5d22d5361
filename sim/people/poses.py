"""Where every part of a person and the board is: at one time, and over many."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.limbs import axis_quaternions, length

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PersonPose:
    """Where every part of the person and the board is, world frame.

    Attributes:
        ends: The two end points of every capsule's axis, in the order of `SEGMENTS`, (17, 2, 3) [m].
        board_position: Centre of the board, (3,) [m]; None without one, like the next two.
        board_quaternion: w, x, y, z; board frame: x out of its face, y to its left, z up, (4,).
        board_face: Centre of the face away from the person, (3,) [m].
        heading: Direction the person looks [rad].
    """

    ends: Array
    board_position: Array | None
    board_quaternion: Array | None
    board_face: Array | None
    heading: float

    @cached_property
    def positions(self) -> Array:
        """Centres of the capsules, (17, 3) [m]."""
        found: Array = 0.5 * (self.ends[:, 0] + self.ends[:, 1])
        return found

    @cached_property
    def quaternions(self) -> Array:
        """w, x, y, z; turns z into the capsules' axes, (17, 4)."""
        axes = self.ends[:, 1] - self.ends[:, 0]
        return axis_quaternions(axes / length(axes))

    @property
    def hands(self) -> Array:
        """Grips of the left and the right hand: the far ends of their axes (2, 3) [m]."""
        return self.ends[[10, 16], 1]


@dataclass(frozen=True)
class PersonPoses:
    """A person and the board at T times, world frame; `poses[k]` is the k-th `PersonPose`.

    Attributes:
        ends: The two end points of every capsule's axis (T, 17, 2, 3) [m].
        headings: Directions the person looks (T,) [rad].
        faces: Centres of the board's face (T, 3) [m]; None without a board, like the next one.
        facings: Directions that the face looks (T,) [rad].
        thickness: Of the board [m].
    """

    ends: Array
    headings: Array
    faces: Array | None = None
    facings: Array | None = None
    thickness: float = 0.0

    def __len__(self) -> int:
        return len(self.ends)

    def __getitem__(self, k: int) -> PersonPose:
        """The k-th pose."""
        if self.faces is None or self.facings is None:
            return PersonPose(self.ends[k], None, None, None, float(self.headings[k]))
        half = 0.5 * self.facings[k]
        turn = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
        return PersonPose(self.ends[k], self.centres[k], turn, self.faces[k], float(self.headings[k]))

    @property
    def hands(self) -> Array:
        """Grips of the left and the right hand (T, 2, 3) [m]."""
        return self.ends[:, [10, 16], 1]

    @cached_property
    def centres(self) -> Array:
        """Of the board (T, 3) [m]."""
        assert self.faces is not None  # there is a board
        assert self.facings is not None
        out = np.stack((np.cos(self.facings), np.sin(self.facings), np.zeros(len(self))), axis=-1)
        found: Array = self.faces - self.thickness / 2 * out
        return found

    @cached_property
    def boards(self) -> Array | None:
        """Poses of the board (T, 4, 4): x out of its face, y to its left, z up; None without one."""
        if self.facings is None:
            return None
        poses = np.zeros((len(self), 4, 4))
        c, s = np.cos(self.facings), np.sin(self.facings)
        poses[:, 0, 0], poses[:, 0, 1], poses[:, 1, 0], poses[:, 1, 1] = c, -s, s, c
        poses[:, 2, 2] = poses[:, 3, 3] = 1.0
        poses[:, :3, 3] = self.centres
        return poses
