"""What people need to know of a robot's cell: where it works, how far it reaches, and what they cannot walk through."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

Array = NDArray[np.float64]
Place = tuple[float, float]

BODY = 0.22  # how near the middle of a body comes to furniture: half a trunk, or the length of a foot [m]
ROUND = 0.15  # how much farther away people go round a corner, since they cut it [m]
HIGH = 1.2  # what begins higher above the floor stops nobody [m]


class Rectangle(NamedTuple):
    """A footprint on the floor: smallest and largest x and y [m]."""

    x0: float
    x1: float
    y0: float
    y1: float

    def grown(self, by: float) -> Rectangle:
        """The rectangle enlarged by this much on every side [m]."""
        return Rectangle(self.x0 - by, self.x1 + by, self.y0 - by, self.y1 + by)

    def contains(self, x: float, y: float) -> bool:
        """Whether a place is inside."""
        return self.x0 < x < self.x1 and self.y0 < y < self.y1


#: The foot of the pedestal that `build_scene` puts robots on.
PEDESTAL = Rectangle(-0.36, 0.24, -0.30, 0.30)


@dataclass(frozen=True)
class FloorPlan:
    """A robot's cell as people see it; robot base frame.

    Attributes:
        floor: Height of the floor, negative [m].
        tool: Where the tool works [m].
        reach: How far the robot reaches from its base axis [m].
        base: Where that axis stands [m].
        obstacles: What nobody can walk through: the pedestal, tables.
    """

    floor: float
    tool: tuple[float, float, float]
    reach: float
    base: Place = (0.0, 0.0)
    obstacles: tuple[Rectangle, ...] = (PEDESTAL,)

    @classmethod
    def of(cls, scene: Any, tool: tuple[float, float, float], reach: float) -> FloorPlan:
        """The cell of a scene: everything fixed to its world that stands on the floor, or not far above it.

        Args:
            scene: From `build_scene`.
            tool: Where the tool works [m].
            reach: How far the robot reaches [m].
        """
        model, data = scene.model, scene.make_data()
        found = []
        for g in np.flatnonzero((model.geom_bodyid == 0) & (model.geom_type != 0)):  # planes are the floor
            centre, half = model.geom_aabb[g].reshape(2, 3)
            turn = data.geom_xmat[g].reshape(3, 3)
            middle, size = data.geom_xpos[g] + turn @ centre, np.abs(turn) @ half
            if middle[2] - size[2] < HIGH - scene.pedestal:
                (x, y, _), (a, b, _) = middle.tolist(), size.tolist()
                found.append(Rectangle(x - a, x + a, y - b, y + b))
        outer = [r for r in found if not any(r != o and r == _common(r, o) for o in found)]
        return cls(-scene.pedestal, tool, reach, obstacles=tuple(dict.fromkeys(outer)))

    def out(self, place: Place, angle: float) -> Place:
        """The first place, from a place on into a direction [rad], where somebody can stand."""
        (x, y), c, s = place, math.cos(angle), math.sin(angle)
        blocked = [r.grown(BODY) for r in self.obstacles]
        for _ in range(len(blocked) + 1):
            inside = [r for r in blocked if r.contains(x, y)]
            if not inside:
                break
            r = inside[0]
            sides = [((r.x1 if c > 0 else r.x0) - x) / c if abs(c) > 1e-9 else math.inf]
            sides.append(((r.y1 if s > 0 else r.y0) - y) / s if abs(s) > 1e-9 else math.inf)
            step = min(sides) + 1e-6
            x, y = x + step * c, y + step * s
        return x, y

    def way(self, start: Place, goal: Place) -> list[Place]:
        """Way-points of the shortest way round everything, the goal last; straight on where there is none.

        Args:
            start: Where from.
            goal: Where to.
        """
        for walls in self._walls:
            points = walls.way(start, goal)
            if points is not None:
                return points
        return [goal]

    @cached_property
    def _walls(self) -> tuple[Walls, ...]:
        """What is in the way of people who take care; and of those who squeeze through, since there is no other way."""
        return tuple(Walls(self.obstacles, body) for body in (BODY, 0.5 * BODY, 0.05 * BODY))


class Walls:
    """Ways round obstacles, by the graph of their corners that see each other.

    Args:
        obstacles: Footprints.
        body: How far from them a way stays; farther by `ROUND` at corners [m].
    """

    def __init__(self, obstacles: Sequence[Rectangle], body: float) -> None:
        self._boxes = np.array([r.grown(body - 1e-4) for r in obstacles]).reshape(-1, 2, 2)
        places = [
            (x, y)
            for r in (obstacle.grown(body + ROUND) for obstacle in obstacles)
            for x, y in itertools.product((r.x0, r.x1), (r.y0, r.y1))
            if not any(other.grown(body).contains(x, y) for other in obstacles)
        ]
        self._corners = np.array(places).reshape(-1, 2)
        self._between = self._lengths(self._corners, self._corners)

    def way(self, start: Place, goal: Place) -> list[Place] | None:
        """Way-points, the goal last; None if there is no way."""
        if not self.crossed(np.array([[*start, *goal]]))[0]:
            return [goal]
        nodes = np.vstack((start, goal, self._corners))
        known = np.zeros((len(nodes), len(nodes)))
        known[2:, 2:] = self._between
        known[:2] = self._lengths(nodes[:2], nodes)
        known[:, :2] = known[:2].T
        before = dijkstra(known, indices=0, return_predecessors=True)[1]
        if before[1] < 0:
            return None
        points, node = [goal], int(before[1])
        while node != 0:
            points.insert(0, (float(nodes[node, 0]), float(nodes[node, 1])))
            node = int(before[node])
        return points

    def _lengths(self, a: Array, b: Array) -> Array:
        """Distances of places (n, 2) and (m, 2) that see each other, 0 for those that do not (n, m)."""
        ends = np.concatenate(np.broadcast_arrays(a[:, None], b[None]), axis=-1).reshape(-1, 4)
        lengths = np.hypot(ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1])
        return np.where(self.crossed(ends), 0.0, lengths).reshape(len(a), len(b))

    def crossed(self, ends: Array) -> NDArray[np.bool_]:
        """Whether lines x, y to x, y (n, 4) lead through anything (n,)."""
        start, along = ends[:, None, :2, None], (ends[:, 2:] - ends[:, :2])[:, None, :, None]
        times = (self._boxes - start) / np.where(np.abs(along) < 1e-12, 1e-12, along)  # (n, boxes, axis, side)
        enter, leave = times.min(axis=3).max(axis=2), times.max(axis=3).min(axis=2)
        return np.asarray((np.maximum(enter, 0.0) < np.minimum(leave, 1.0)).any(axis=1))


def _common(a: Rectangle, b: Rectangle) -> Rectangle:
    """The rectangle that two share."""
    return Rectangle(max(a.x0, b.x0), min(a.x1, b.x1), max(a.y0, b.y0), min(a.y1, b.y1))
