"""Nearest points of every moving body of the robot, body by body: to everybody, or to each of some points."""

from __future__ import annotations

from math import inf, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import entry, linked
from qpsafe.compiled.memory import view
from qpsafe.geometry.layout import BODY
from qpsafe.geometry.pairs import PAIR
from qpsafe.geometry.separation import hull_types
from qpsafe.robot.kinematics import Index, cut
from qpsafe.sim.engine import nearest
from qpsafe.sim.engine.nearest import robot_to_people

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.sim.engine.world import World

Array = NDArray[np.float64]

_to_people = linked(robot_to_people, *nearest.USES)
_ints, _pairs = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 2, "C", readonly=True)
_one, _two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))


class Near(NamedTuple):
    """Pairs of nearest points, k of them.

    Attributes:
        distance: Negative where they overlap (k,) [m].
        on_robot, on_other: World frame (k, 3) [m].
        body: Of the robot, as in its tree (k,).
        rows: nᵀ J of the robot's points, n towards the others (k, n): times q̇ the speed of approach [m/s].
    """

    distance: Array
    on_robot: Array
    on_other: Array
    body: Index
    rows: Array


class Bodies:
    """The robot's moving bodies, each with its shapes.

    Args:
        world: The world.
        robot: The robot.
    """

    def __init__(self, world: World, robot: Robot) -> None:
        self._world, self._robot = world, robot
        owners = world.index[world.robot, BODY]
        moving = np.unique(owners[owners > 0])
        self.numbers: Index = moving.astype(np.int64)
        members = [world.robot[owners == body] for body in moving]
        self._members = np.concatenate(members).astype(np.int64)
        self._first = np.cumsum([0, *map(len, members)]).astype(np.int64)

    def to_people(self, state: RobotState, people: tuple[Array, ...], at_most: float) -> Near:
        """Where everybody, boards included, is nearest to each body.

        Args:
            state: The robot.
            people: A row of `PersonTracks`.
            at_most: Farther away nothing is looked for [m].
        """
        return self._measure(state, people, at_most)

    def to_each(self, state: RobotState, people: tuple[Array, ...], at_most: float) -> Near:
        """Where every capsule of everybody, and every board, is nearest to each body.

        Args:
            state: The robot.
            people: A row of `PersonTracks`.
            at_most: Farther away nothing is looked for [m].
        """
        ends, radii, balls, boards, half_sizes = people
        axes = ends[:, 1] - ends[:, 0]
        own = np.column_stack((ends.mean(axis=1), 0.5 * np.sqrt((axes * axes).sum(axis=1)) + radii))
        parts = self._measure(state, (ends, radii, own, boards[:0], half_sizes[:0]), at_most, len(radii))
        for b in range(len(boards)):
            none = ends[:0], radii[:0], balls[:0]
            one = self._measure(state, (*none, boards[b : b + 1], half_sizes[b : b + 1]), at_most)
            parts = Near(*(np.concatenate(pair) for pair in zip(parts, one, strict=True)))
        return parts

    def to_points(self, state: RobotState, points: Array, at_most: float) -> Near:
        """Every body against every point.

        Args:
            state: The robot.
            points: (p, 3) [m].
            at_most: Farther away nothing is looked for [m].
        """
        p = len(points)
        ends = np.repeat(np.ascontiguousarray(points)[:, None], 2, axis=1)  # capsules without length and radius
        balls = np.column_stack((points, np.zeros(p)))
        return self._measure(state, (ends, np.zeros(p), balls, np.empty((0, 4, 4)), np.empty((0, 3))), at_most, p)

    def _measure(self, state: RobotState, people: tuple[Array, ...], at_most: float, groups: int = 1) -> Near:
        robot, count = self._robot, groups * len(self.numbers)
        found, rows, bodies = np.empty((count, 7)), np.empty((count, robot.nq)), np.empty(count, dtype=np.int64)
        work = np.empty(PAIR + len(self._members) * (len(people[1]) + len(people[3])))
        k = 0
        if groups:
            k = _by_body(
                state.memory, robot.tree.supports, robot.ends, self.numbers, self._first, self._members,
                *self._world.solid, *people, groups, at_most, work, found, rows, bodies,
            )  # fmt: skip
        return Near(found[:k, 0], found[:k, 1:4], found[:k, 4:], bodies[:k], rows[:k])


@entry(
    types.int64(
        _one, _two, types.int64, _ints, _ints, _ints, _pairs, _two, *hull_types, _three, _one, _two, _three, _two,
        types.int64, types.float64, types.float64[::1], types.float64[:, ::1], types.float64[:, ::1], types.int64[::1],
    ),
    *nearest.USES, nearest, compiled,
)  # fmt: skip
def _by_body(
    memory: Array, supports: Array, ends_of_wire: int, numbers: Index, first: Index, members: Index, index: Index,
    shapes: Array, vertices: Array, starts: Index, neighbours: Index, planes: Array, ends: Array, radii: Array,
    balls: Array, boards: Array, half_sizes: Array, groups: int, at_most: float, work: Array,
    found: Array, rows: Array, bodies: Index,
) -> int:  # fmt: skip
    """Fill found (k, 7), see `robot_to_people`, rows and bodies; returns k.

    People are measured in equal groups, one after the other; boards need a single group.
    members[first[b]:first[b + 1]] are the shapes of body numbers[b].
    """
    n, count = supports.shape[1], 0
    poses, twists = cut(memory, n, ends_of_wire)[:2]
    for g in range(groups):
        s, p = radii.shape[0] // groups, balls.shape[0] // groups
        for b in range(numbers.shape[0]):
            _to_people(
                poses, view(members, first[b], (first[b + 1] - first[b],)), index, shapes, vertices, starts, neighbours,
                planes, view(ends, 6 * g * s, (s, 2, 3)), view(radii, g * s, (s,)), view(balls, 4 * g * p, (p, 4)),
                boards, half_sizes, at_most, work, view(found, 7 * count, (7,)),
            )  # fmt: skip
            if not found[count, 0] < inf:
                continue
            x, y, z = found[count, 1], found[count, 2], found[count, 3]
            a, c, d = found[count, 4] - x, found[count, 5] - y, found[count, 6] - z
            length = sqrt(a * a + c * c + d * d)
            w = 1.0 / length if length > 0.0 else 0.0
            for j in range(n):
                # nᵀ (v + ω × p)
                along = a * (twists[0, j] + twists[4, j] * z - twists[5, j] * y)
                along += c * (twists[1, j] + twists[5, j] * x - twists[3, j] * z)
                along += d * (twists[2, j] + twists[3, j] * y - twists[4, j] * x)
                rows[count, j] = supports[numbers[b], j] * w * along
            bodies[count] = numbers[b]
            count += 1
    return count
