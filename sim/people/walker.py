"""Smooth motion of a person's root: walks along way-points with rounded corners, and turns on the spot.

A walk is the polyline through the way-points at constant speed, smoothed in time by the kernel

    k(s) = (1 + cos(2 pi s / T)) / T,  |s| <= T/2,

so it starts and ends at rest, is twice continuously differentiable, and never exceeds the speed: the velocity is an
average of the polyline's. A corner is cut by about 0.07 T |dv|, 0.1 m for a right angle at 1 m/s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.paces import eased, ramped

EASE = 0.5, 0.5  # T: at no speed [s], and what each m/s adds to it
TURNING = math.radians(150.0)  # peak rate of a turn [rad/s]
SHARP = math.radians(100.0)  # sharper corners are stopped at

Array = NDArray[np.float64]
Root = tuple[float, float, float]  # x [m], y [m], heading [rad]
Roots = tuple[Array, Array, Array]  # the same at many times


class Piece(Protocol):
    """A stretch of motion from `start` to `end` [s]."""

    @property
    def start(self) -> float:
        """When it begins [s]."""

    @property
    def end(self) -> float:
        """When it ends [s]."""

    def __call__(self, times: Array) -> Roots:
        """The root at times in between."""


class Turn(NamedTuple):
    """A turn on the spot by `angle` [rad]."""

    start: float
    end: float
    root: Root
    angle: float

    def __call__(self, times: Array) -> Roots:
        """The root at times (T,)."""
        x, y, heading = self.root
        turned = heading + self.angle * eased((times - self.start) / max(self.end - self.start, 1e-9))
        return np.full_like(turned, x), np.full_like(turned, y), turned


class Walk:
    """A walk from a root along way-points, turning towards travel unless told to keep the heading."""

    def __init__(
        self,
        start: float,
        root: Root,
        points: Sequence[tuple[float, float]],
        speed: float,
        turning: bool = True,
        ease: float | None = None,
        stop: float | None = None,
    ) -> None:
        """Plan it: `start` [s], way-points (x, y) [m], speed [m/s], T [s]; no corner may be sharper than `SHARP`.

        Args:
            start: When [s].
            root: From where.
            points: Way-points.
            speed: Between the corners.
            turning: Towards travel; else the heading stays.
            ease: T, time of speeding up, of slowing down and of a corner; by default longer the faster.
            stop: T of slowing down at the end, if that is another one.
        """
        corners = np.array([root[:2], *points])
        legs = np.diff(corners, axis=0)
        lengths = np.hypot(*legs.T)
        self.start, self._root, self.ease = start, root, ease or EASE[0] + EASE[1] * speed
        self._times = start + 0.5 * self.ease + np.concatenate(([0.0], np.cumsum(lengths))) / speed
        # the end's smoothing begins and ends after that of the corner before, or the velocity were no average any more
        apart = 2.0 * float(lengths[-1]) / speed
        last = min(max(stop or self.ease, self.ease - apart), self.ease + apart)
        self._eases = np.array([*[self.ease] * len(legs), last])
        self.end = float(self._times[-1] + 0.5 * last)
        velocities = speed * legs / lengths[:, None]
        self._changes: Array = np.diff(velocities, axis=0, prepend=0.0, append=0.0)
        directions = np.arctan2(legs[:, 1], legs[:, 0])
        turns: list[tuple[float, float, float]] = []  # start, duration, angle
        for time, angle in zip(self._times[1:-1], np.diff(directions), strict=True):
            if turning:
                by = math.remainder(angle, 2.0 * math.pi)
                width = min(max(self.ease, 2.0 * abs(by) / TURNING), 2.0 * (time - start), 2.0 * (self.end - time))
                turns.append((time - 0.5 * width, width, by))
        self._turns: Array = np.array(turns).reshape(-1, 3)
        heading = root[2] + float(self._turns[:, 2].sum())
        self.goal: Root = (float(corners[-1, 0]), float(corners[-1, 1]), heading)

    def __call__(self, times: Array) -> Roots:
        """The root at times (T,)."""
        times = np.asarray(times)
        done, after = times >= self.end, times[..., None]
        moved = (ramped(after - self._times, self._eases)[..., None] * self._changes).sum(axis=-2)
        start, duration, by = self._turns.T
        turned = (by * eased((after - start) / duration)).sum(axis=-1)
        steps = (moved[..., 0], moved[..., 1], turned)
        x, y, heading = (np.where(done, a, b + c) for a, b, c in zip(self.goal, self._root, steps, strict=True))
        return x, y, heading


class Course:
    """Pieces one after another; the root stands still between them."""

    def __init__(self, root: Root) -> None:
        """Begin at a root."""
        self._starts: list[float] = []
        self._pieces: list[Piece] = []
        self._first = self.last = root
        self.end = 0.0  # of the last piece [s]

    def add(self, piece: Piece) -> float:
        """Append a piece that starts where the last one ended; returns its end [s]."""
        self._starts.append(piece.start)
        self._pieces.append(piece)
        x, y, heading = (float(value) for value in piece(np.array(piece.end)))
        self.last, self.end = (x, y, heading), piece.end
        return piece.end

    def __call__(self, times: Array | float) -> Roots:
        """The root at times [s]: x, y [m], heading [rad], each in the shape of the times."""
        times = np.asarray(times, dtype=float)
        which = np.searchsorted(self._starts, times, side="right") - 1
        roots = np.broadcast_to(np.reshape(self._first, (3, *[1] * times.ndim)), (3, *times.shape)).copy()
        for k, piece in enumerate(self._pieces):
            now = which == k
            if now.any():
                roots[:, now] = piece(np.minimum(times[now], piece.end))
        return roots[0], roots[1], roots[2]

    def speed(self, times: Array | float) -> Array:
        """Of the root, by differences over 0.1 s [m/s]."""
        times = np.asarray(times, dtype=float)
        x, y, _ = self(np.stack((times - 0.05, times + 0.05)))
        return np.asarray(np.hypot(x[1] - x[0], y[1] - y[0]) / 0.1)
