"""Smooth motion of a person's root: walks along way-points with rounded corners, and turns on the spot.

A walk is the polyline through the way-points at constant speed, smoothed in time by the kernel

    k(s) = (1 + cos(2 pi s / T)) / T,  |s| <= T/2,

so it starts and ends at rest, is twice continuously differentiable, and never exceeds the speed: the velocity is an
average of the polyline's. A corner is cut by about 0.07 T |dv|, 0.1 m for a right angle at 1 m/s.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

EASE = 0.5, 0.5  # T: at no speed [s], and what each m/s adds to it
TURNING = math.radians(150.0)  # peak rate of a turn [rad/s]
SHARP = math.radians(100.0)  # sharper corners are stopped at

Root = tuple[float, float, float]  # x [m], y [m], heading [rad]


def eased(share: float) -> float:
    """From 0 to 1 for shares of time 0 to 1, at rest at both ends; the integral of the kernel. Fastest rate: 2."""
    share = min(max(share, 0.0), 1.0)
    return share - math.sin(2.0 * math.pi * share) / (2.0 * math.pi)


def ramped(time: float, ease: float) -> float:
    """max(time, 0) smoothed by the kernel of width `ease`: the integral of `eased` [s]."""
    if time <= -0.5 * ease:
        return 0.0
    if time >= 0.5 * ease:
        return time
    u = time / ease
    return ease * (0.5 * u * u + 0.5 * u + 0.125 - (1.0 + math.cos(2.0 * math.pi * u)) / (4.0 * math.pi**2))


class Piece(Protocol):
    """A stretch of motion from `start` to `end` [s]."""

    @property
    def start(self) -> float:
        """When it begins [s]."""

    @property
    def end(self) -> float:
        """When it ends [s]."""

    def __call__(self, time: float) -> Root:
        """The root at a time in between."""


class Turn(NamedTuple):
    """A turn on the spot by `angle` [rad]."""

    start: float
    end: float
    root: Root
    angle: float

    def __call__(self, time: float) -> Root:
        """The root at a time."""
        x, y, heading = self.root
        return x, y, heading + self.angle * eased((time - self.start) / max(self.end - self.start, 1e-9))


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
    ) -> None:
        """Plan it: `start` [s], way-points (x, y) [m], speed [m/s], T [s]; no corner may be sharper than `SHARP`.

        Args:
            start: When [s].
            root: From where.
            points: Way-points.
            speed: Between the corners.
            turning: Towards travel; else the heading stays.
            ease: T, time of speeding up, of slowing down and of a corner; by default longer the faster.
        """
        corners = np.array([root[:2], *points])
        legs = np.diff(corners, axis=0)
        lengths = np.hypot(*legs.T)
        self.start, self._root, self.ease = start, root, ease or EASE[0] + EASE[1] * speed
        self._times = start + 0.5 * self.ease + np.concatenate(([0.0], np.cumsum(lengths))) / speed
        self.end = float(self._times[-1] + 0.5 * self.ease)
        velocities = speed * legs / lengths[:, None]
        self._changes: NDArray[np.float64] = np.diff(velocities, axis=0, prepend=0.0, append=0.0)
        directions = np.arctan2(legs[:, 1], legs[:, 0])
        self._turns: list[tuple[float, float, float]] = []  # start, duration, angle
        for time, angle in zip(self._times[1:-1], np.diff(directions), strict=True):
            if turning:
                by = math.remainder(angle, 2.0 * math.pi)
                width = min(max(self.ease, 2.0 * abs(by) / TURNING), 2.0 * (time - start), 2.0 * (self.end - time))
                self._turns.append((time - 0.5 * width, width, by))
        heading = root[2] + sum(by for _, _, by in self._turns)
        self.goal: Root = (float(corners[-1, 0]), float(corners[-1, 1]), heading)

    def __call__(self, time: float) -> Root:
        """The root at a time."""
        if time >= self.end:
            return self.goal
        x, y, heading = self._root
        for at, (vx, vy) in zip(self._times, self._changes, strict=True):
            if time <= at - 0.5 * self.ease:
                break
            share = ramped(time - at, self.ease)
            x += vx * share
            y += vy * share
        for start, duration, by in self._turns:
            heading += by * eased((time - start) / duration)
        return float(x), float(y), float(heading)


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
        self.last, self.end = piece(piece.end), piece.end
        return piece.end

    def __call__(self, time: float) -> Root:
        """The root at a time [s]."""
        index = bisect.bisect_right(self._starts, time) - 1
        return self._first if index < 0 else self._pieces[index](min(time, self._pieces[index].end))

    def speed(self, time: float) -> float:
        """Of the root, by a difference over 0.1 s [m/s]."""
        (x1, y1, _), (x2, y2, _) = self(time - 0.05), self(time + 0.05)
        return math.hypot(x2 - x1, y2 - y1) / 0.1
