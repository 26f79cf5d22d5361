"""True distances along a whole run, in one compiled call each: to people at every tick, to furniture and to itself."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import add, dot, entry, linked
from qpsafe.compiled.memory import view
from qpsafe.geometry import pairs
from qpsafe.geometry.layout import BALL, BODY, KIND, PLANE
from qpsafe.geometry.pairs import PAIR, nearest_pair
from qpsafe.geometry.separation import hull_types
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut, forward, place
from qpsafe.sim.engine import nearest
from qpsafe.sim.engine.nearest import robot_to_people
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.sim.engine.tracks import PersonTracks

Array = NDArray[np.float64]

_forward = linked(forward)
_to_people, _of_pairs = linked(robot_to_people, *nearest.USES), linked(nearest_pair, *pairs.USES)
_ints, _pairs = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 2, "C", readonly=True)
_one, _two, _three, _four = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3, 4))


class Closest(NamedTuple):
    """Nearest points of robot and people at each of T ticks.

    Attributes:
        distance: [m], negative where they overlap (T,).
        on_robot, on_person: World frame (T, 3) [m].
        body: Of the robot, as in its tree, 0 for its base (T,).
        segment: Number of the capsule; from the number of capsules on, that of a board (T,).
    """

    distance: Array
    on_robot: Array
    on_person: Array
    body: Index
    segment: Index

    def approach(self, robot: Robot, q: Array, qd: Array) -> Array:
        """Speed of the robot's nearest point towards the person's (T,) [m/s].

        Args:
            robot: The robot.
            q: (T, n) [rad].
            qd: (T, n) [rad/s].
        """
        speeds = np.empty(len(q))
        _approach(q, qd, *robot.tree, self.on_robot, self.on_person, self.body, np.empty(robot.memory), speeds)
        return speeds


def closest(station: Station, q: Array, tracks: PersonTracks, at_most: float = np.inf) -> Closest:
    """Nearest points of the robot, its base included, and people.

    Args:
        station: With robot and world.
        q: Joint position at every tick (T, n) [rad].
        tracks: Everybody at the same ticks.
        at_most: Larger distances are told as +inf, unless all are larger [m].

    Raises:
        ValueError: Fewer ticks of people than of the robot: compiled code would read beyond them.
    """
    if len(q) > len(tracks.ends):
        raise ValueError(f"a robot's way has {counted(len(q), 'tick')}, that of people {len(tracks.ends)}")
    ticks, (world, robot) = len(q), (station.world, station.robot)
    found, which = np.full((ticks, 7), np.nan), np.empty((ticks, 2), dtype=np.int64)
    boards = tracks.boards
    work = np.empty(PAIR + len(world.robot) * (len(tracks.radii) + boards.shape[1]))
    for limit in (at_most, np.inf):
        _along_people(
            np.ascontiguousarray(q), *robot.tree, world.robot, *world.solid, tracks.ends, tracks.radii, tracks.balls,
            boards, tracks.half_sizes, limit, np.empty(robot.memory), work, found, which,
        )  # fmt: skip
        if np.isfinite(found[:, 0]).any():
            break
    body = world.index[which[:, 0], BODY]
    return Closest(found[:, 0], found[:, 1:4], found[:, 4:], body, which[:, 1])


def smallest(station: Station, q: Array, pairs: Index) -> float:
    """Smallest distance over some pairs of shapes in a whole run [m]; +inf without pairs.

    Args:
        station: With robot and world.
        q: (T, n) [rad].
        pairs: Such as `Distances.own` (m, 2).
    """
    return PairsAlong(station, pairs).smallest(q)


class PairsAlong:
    """Pairs of shapes, to be measured along many runs that begin alike.

    Args:
        station: With robot and world.
        pairs: Such as `Distances.own` (m, 2).
        start: Joint position at which the runs begin (n,) [rad]; None where they begin anywhere.
    """

    def __init__(self, station: Station, pairs: Index, start: Array | None = None) -> None:
        world, robot = station.world, station.robot
        bodies, supports = world.index[pairs, BODY], robot.tree.supports
        # joints that move one of the two and not the other change their distance by no more than the way of its points
        ways = np.abs(supports[bodies[:, 0]] - supports[bodies[:, 1]]) * ways_of(station)
        self._fixed = (*robot.tree, pairs, *world.solid, np.ascontiguousarray(ways))
        self._work = np.empty(robot.memory), np.empty(PAIR + 3 * len(world.names) + 1), np.empty(7)
        self._least, self._bounds = np.full(len(pairs), -np.inf), np.empty(len(pairs))
        if start is not None:
            _along_pairs(start[None], *self._fixed, 0.0, self._least, *self._work)

    def smallest(self, q: Array, at_most: float = np.inf) -> float:
        """Smallest distance in a run [m]; `at_most` if none is smaller.

        Args:
            q: (T, n) [rad]; its first row is `start`, if there is one.
            at_most: Larger distances are not looked for [m].
        """
        self._bounds[:] = self._least
        return float(_along_pairs(np.ascontiguousarray(q), *self._fixed, at_most, self._bounds, *self._work))


def ways_of(station: Station) -> Array:
    """How far a point of the robot moves at most for each unit of a joint (n,) [m/rad, 1]."""
    tree, robot, world = station.robot.tree, station.robot, station.world
    slides = np.abs(tree.axes[:, :3]).any(axis=1)
    travel = np.where(slides, np.maximum(np.abs(robot.lower), np.abs(robot.upper)), 0.0)
    balls = world.shapes[world.robot, BALL : BALL + 4]
    outer = float((np.linalg.norm(balls[:, :3], axis=1) + balls[:, 3]).max())
    steps = np.linalg.norm(tree.placements[:, :3, 3], axis=1) + travel
    below = [float((tree.supports[1:, j] * steps).sum() - steps[j]) for j in range(robot.nq)]  # of bodies further out
    return np.where(slides, 1.0, np.array(below) + outer)


_SPARE = 0.05  # farther than this above the smallest distance it need not be known exactly [m]
_tree = (*kinematics.tree_types,)


@entry(
    types.void(
        _two, *_tree, _ints, _pairs, _two, *hull_types, _four, _one, _three, _four, _two,
        types.float64, types.float64[::1], types.float64[::1], types.float64[:, ::1], types.int64[:, ::1],
    ),
    *nearest.USES, nearest, compiled,
)  # fmt: skip
def _along_people(
    q: Array, parents: Index, placements: Array, axes: Array, supports: Array, end_bodies: Index, end_places: Array,
    robot: Index, index: Index, shapes: Array, vertices: Array, starts: Index, neighbours: Index, planes: Array,
    ends: Array, radii: Array, balls: Array, boards: Array, half_sizes: Array, at_most: float, memory: Array,
    work: Array, found: Array, which: Index,
) -> None:  # fmt: skip
    """Fill found (T, 7) and which (T, 2), see `robot_to_people`."""
    ticks, n, segments, people = q.shape[0], q.shape[1], radii.shape[0], balls.shape[1]
    held = boards.shape[1]
    for k in range(ticks):
        _forward(view(q, k * n, (n,)), parents, placements, axes, supports, end_bodies, end_places, memory)
        poses = cut(memory, n, end_bodies.shape[0])[0]
        which[k, 0], which[k, 1] = _to_people(
            poses, robot, index, shapes, vertices, starts, neighbours, planes,
            view(ends, k * segments * 6, (segments, 2, 3)), radii, view(balls, k * people * 4, (people, 4)),
            view(boards, k * held * 16, (held, 4, 4)), half_sizes, at_most, work, view(found, 7 * k, (7,)),
        )  # fmt: skip


@entry(
    types.float64(_two, *_tree, _pairs, _pairs, _two, *hull_types, _two, types.float64, *[types.float64[::1]] * 4),
    *nearest.USES, nearest, compiled,
)  # fmt: skip
def _along_pairs(
    q: Array, parents: Index, placements: Array, axes: Array, supports: Array, end_bodies: Index, end_places: Array,
    pairs: Index, index: Index, shapes: Array, vertices: Array, starts: Index, neighbours: Index, planes: Array,
    ways: Array, at_most: float, least: Array, memory: Array, work: Array, found: Array,
) -> float:  # fmt: skip
    """The smallest distance of all ticks, `at_most` if none is smaller.

    Every pair has a lower bound of its distance, `least`, which falls as joints move: a pair is measured where it could
    be the nearest one.
    """
    n, best = q.shape[1], at_most
    for k in range(q.shape[0]):
        placed = False
        for p in range(pairs.shape[0]):
            if k > 0:
                fall = 0.0
                for j in range(n):
                    fall += ways[p, j] * abs(q[k, j] - q[k - 1, j])
                least[p] -= fall
            if least[p] >= best:
                continue
            if not placed:
                _forward(
                    view(q, k * n, (n,)), parents, placements, axes, supports, end_bodies, end_places, memory
                )  # fmt: skip
                placed = True
            poses, a, b = cut(memory, n, end_bodies.shape[0])[0], pairs[p, 0], pairs[p, 1]
            if index[b, KIND] != PLANE:  # balls around both
                u = place(poses[index[a, BODY]], shapes[a, BALL], shapes[a, BALL + 1], shapes[a, BALL + 2])
                v = place(poses[index[b, BODY]], shapes[b, BALL], shapes[b, BALL + 1], shapes[b, BALL + 2])
                u = add(u, -1.0, v)
                least[p] = sqrt(dot(u, u)) - shapes[a, BALL + 3] - shapes[b, BALL + 3]
                if least[p] >= best + _SPARE:
                    continue
            near = _of_pairs(
                poses, view(pairs, 2 * p, (1, 2)), index, shapes, vertices, starts, neighbours, planes, best + _SPARE,
                work, found,
            )  # fmt: skip
            least[p] = found[0] if near >= 0 else best + _SPARE
            best = min(best, least[p]) if near >= 0 else best
    return best


@entry(
    types.void(_two, _two, *_tree, *[types.Array(types.float64, 2, "A", readonly=True)] * 2, _ints,
               types.float64[::1], types.float64[::1]),
    kinematics, compiled,
)  # fmt: skip
def _approach(
    q: Array, qd: Array, parents: Index, placements: Array, axes: Array, supports: Array, end_bodies: Index,
    end_places: Array, on_robot: Array, on_person: Array, body: Index, memory: Array, speeds: Array,
) -> None:  # fmt: skip
    """nᵀ J q̇ of the robot's nearest points, n towards the person."""
    n = q.shape[1]
    for k in range(q.shape[0]):
        _forward(view(q, k * n, (n,)), parents, placements, axes, supports, end_bodies, end_places, memory)
        twists = cut(memory, n, end_bodies.shape[0])[1]
        x, y, z = on_robot[k, 0], on_robot[k, 1], on_robot[k, 2]
        v0, v1, v2 = 0.0, 0.0, 0.0
        for j in range(n):
            s = supports[body[k], j] * qd[k, j]
            # v + ω × p
            v0 += s * (twists[0, j] + twists[4, j] * z - twists[5, j] * y)
            v1 += s * (twists[1, j] + twists[5, j] * x - twists[3, j] * z)
            v2 += s * (twists[2, j] + twists[3, j] * y - twists[4, j] * x)
        a, b, c = on_person[k, 0] - x, on_person[k, 1] - y, on_person[k, 2] - z
        length = np.sqrt(a * a + b * b + c * c)
        speeds[k] = (v0 * a + v1 * b + v2 * c) / length if length > 0.0 else 0.0
