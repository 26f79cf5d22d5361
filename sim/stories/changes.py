"""What changes while a story goes on: numbers that go smoothly from place to place, and where a hand is to be."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.paces import COSINE, paced
from qpsafe.sim.people.posture import Point, between, goal_row
from qpsafe.sim.people.walker import Root, Roots

Array = NDArray[np.float64]


class Changes:
    """Rows of k numbers that go smoothly from one to the next, one change after another, and stay in between.

    Attributes:
        last: Where it ends (k,).
        end: When the last change is done [s].
    """

    def __init__(self, first: Sequence[float] | Array) -> None:
        """Begin at a row."""
        self.last, self.end = np.array(first, dtype=float), -math.inf
        self._rows: list[tuple[float, float, float, float, Array, Array]] = [
            (-math.inf, 0.0, COSINE, 0.0, self.last, self.last)
        ]

    def add(
        self, start: float, end: float, to: Sequence[float] | Array, late: float = COSINE, lift: float = 0.0
    ) -> None:
        """Append a change.

        Args:
            start: When it begins, not before the last one ends [s].
            end: When it is done [s].
            to: Row at its end.
            late: How it goes, see `paces`.
            lift: For hands: how much higher than on the straight way in the middle of it [m].
        """
        row = np.array(to, dtype=float)
        self._rows.append((start, end, late, lift, self.last, row))
        self.last, self.end = row, end

    def __call__(self, times: Array) -> Array:
        """Rows at times (T,) [s]: (T, k)."""
        start, end, late, lift, a, b = (np.array(column) for column in zip(*self._rows, strict=True))
        which = np.searchsorted(start, times, side="right") - 1
        start[0] = -1.0  # has been there for ever
        share = paced((times - start[which]) / (end - start)[which], late[which])[:, None]
        return between(a[which], b[which], share, lift[which, None])


def world_row(goal: Point | str, root: Root, floor: float) -> Array:
    """Like `goal_row`, of a point that stays where it is in the world while the root goes on.

    Args:
        goal: A point of the root's frame [m], or where the arm hangs or holds.
        root: Where the root is when the hand is there.
        floor: Height of the floor [m].

    Returns:
        Shares of hanging hand and of the board's edge, point in the root's frame, point in the world times the share
        of it, and that share (9,).
    """
    row = np.concatenate((goal_row(goal), np.zeros(4)))
    if not isinstance(goal, str):
        (x, y, heading), (ahead, aside, up) = root, goal
        c, s = math.cos(heading), math.sin(heading)
        row[2:] = 0.0, 0.0, 0.0, x + c * ahead - s * aside, y + s * ahead + c * aside, up + floor, 1.0
    return row


def local_rows(rows: Array, roots: Roots, floor: float) -> Array:
    """Rows of `world_row` (T, 9) as the person has them at its roots: rows of `goal_row` (T, 5).

    Args:
        rows: (T, 9).
        roots: x, y [m] and heading [rad], (T,) each.
        floor: Height of the floor [m].
    """
    x, y, heading = roots
    c, s, share = np.cos(heading), np.sin(heading), rows[:, 8]
    dx, dy, up = rows[:, 5] - share * x, rows[:, 6] - share * y, rows[:, 7] - share * floor
    found = rows[:, :5].copy()
    found[:, 2:] += np.stack((c * dx + s * dy, c * dy - s * dx, up), axis=-1)
    return found
