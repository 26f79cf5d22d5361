"""A robot's capsules, a cell's solids and the figures of a verified motion as the blocks of `Tables`."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from qpsafe.gate.capsules import Capsules, capsules_of, joined
from qpsafe.gate.levers import levers
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.gate.tables import HEADER, lengths
from qpsafe.gate.wire_capsules import wire_capsules
from qpsafe.geometry.layout import BODY, POSE, SIZE, VERTEX, VERTICES
from qpsafe.geometry.solids import Solids
from qpsafe.sensing.body import body_hulls

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from qpsafe.limits import JointLimits
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.hulls import Obstacle

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FARTHEST = 0.4  # larger distances of solids are not measured [m]
MOMENT = 0.1  # within which a link must be able to get away [s]
MOST = 16  # cells that are kept a robot
_surroundings: WeakKeyDictionary[Robot, OrderedDict[Any, Any]] = WeakKeyDictionary()
_capsules: WeakKeyDictionary[Robot, Capsules] = WeakKeyDictionary()
_bare: WeakKeyDictionary[Robot, Capsules] = WeakKeyDictionary()
_levers: WeakKeyDictionary[Robot, Array] = WeakKeyDictionary()


class Group(NamedTuple):
    """Pairs of shapes of one body against what stands, or of two bodies.

    Attributes:
        bodies: Of the robot's tree; the second is 0 for what stands.
        lever: (n,), how fast the two can come nearer per unit speed of each joint.
        pairs: (m, 2).
    """

    bodies: tuple[int, int]
    lever: Array
    pairs: Index


def robot_capsules(robot: Robot) -> Capsules:
    """Capsules that contain the robot's collision geometry, and the wire's links that have none; made once a robot."""
    if robot not in _capsules:
        _capsules[robot] = joined(capsules_of(body_hulls(robot)), bare_links(robot))
    return _capsules[robot]


def capsule_levers(robot: Robot) -> Array:
    """How fast each joint moves any point of each capsule's axis at most (c, n) [m/rad, 1]; made once a robot."""
    if robot not in _levers:
        capsules = robot_capsules(robot)
        rows = [levers(robot, int(body), ends) for body, ends in zip(capsules.bodies, capsules.ends, strict=True)]
        _levers[robot] = np.reshape(rows, (len(rows), robot.nq))
    return _levers[robot]


def bare_links(robot: Robot) -> Capsules:
    """Capsules of those links of the robot's wire whose body has no collision geometry."""
    if robot not in _bare:
        shaped = {body for body, _, _ in body_hulls(robot)}
        tree = set(range(1, robot.nq + 1))
        _bare[robot] = wire_capsules(robot, tree - shaped) if tree - shaped else capsules_of([])
    return _bare[robot]


def surroundings(
    robot: Robot, known: Sequence[Obstacle], carried: Mapping[str, Sequence[Obstacle]] | None
) -> tuple[Solids, list[Group]]:
    """Solids of a robot and around it, and their groups; kept, since a cell's controllers share them.

    Args:
        robot: The robot.
        known: Known obstacles.
        carried: What tools may carry, by frame.
    """
    things = tuple((frame, thing) for frame, carries in (carried or {}).items() for thing in carries)
    key = (*map(id, known), 0, *((frame, id(thing)) for frame, thing in things))
    kept = _surroundings.setdefault(robot, OrderedDict())
    if key not in kept:
        solids = Solids.of(robot, known, carried)
        kept[key] = (
            (tuple(known), things),
            solids,
            groups_of(robot, solids),
        )  # things stay, so that their ids are theirs
        if len(kept) > MOST:
            kept.popitem(last=False)
    return kept[key][1:]


def groups_of(robot: Robot, solids: Solids) -> list[Group]:
    """The pairs of solids that must not touch, grouped.

    Args:
        robot: The robot.
        solids: Its shapes and those around it.
    """
    bodies, supports = solids.index[:, BODY], robot.tree.supports
    of_body: dict[int, Array] = {}

    def lever(body: int) -> Array:
        if body not in of_body:
            shapes = [i for i in range(len(bodies)) if bodies[i] == body and i in mine]
            of_body[body] = levers(robot, body, np.vstack([_vertices(solids, i) for i in shapes]))
        return of_body[body]

    links = len(body_hulls(robot))  # what tools carry may touch furniture: it is taken from there
    furniture = [pair for pair in solids.furniture.tolist() if pair[0] < links]
    mine = {shape for pair in furniture for shape in pair[:1]} | set(solids.own.ravel().tolist())
    chosen: dict[tuple[int, int], list[Any]] = {}
    for pair in (*furniture, *solids.own.tolist()):
        a, b = (int(bodies[i]) for i in pair)
        chosen.setdefault((max(a, b), min(a, b)), []).append(pair)
    made = []
    for (a, b), pairs in sorted(chosen.items()):
        # joints that move both bodies do not move them against each other
        apart = supports[a] != supports[b]
        both = lever(a) + (lever(b) if b > 0 else 0.0)
        made.append(Group((a, b), np.where(apart, both, 0.0), np.array(pairs, dtype=np.int64)))
    return made


def _vertices(solids: Solids, shape: int) -> Array:
    """Corners of a shape's hull in its body's frame (v, 3)."""
    row, numbers = solids.index[shape], solids.shapes[shape]
    place = numbers[POSE:SIZE].reshape(3, 4)
    own = solids.vertices[row[VERTEX] : row[VERTEX] + row[VERTICES]]
    return own @ place[:, :3].T + place[:, 3]


def pack(
    robot: Robot, figures: tuple[VerifiedMotion, JointLimits, float], solids: Solids, groups: list[Group]
) -> tuple[Array, Index]:
    """Blocks of floats and integers, read-only.

    Args:
        robot: The robot.
        figures: Those of the rules, the limits by which it brakes, and how old a reading may be [s].
        solids: Of the robot and around it.
        groups: Their pairs.
    """
    capsules, tree, n = robot_capsules(robot), robot.tree, robot.nq
    rules, limits, max_age = figures
    far = capsule_levers(robot)
    pairs = np.vstack([np.zeros((0, 2), dtype=np.int64), *(group.pairs for group in groups)])
    sizes = np.array((n, len(far), len(groups), len(pairs), len(solids.index), len(solids.vertices),
                      len(solids.neighbours), len(solids.planes)), dtype=np.int64)  # fmt: skip
    numbers = (
        limits.dt, rules.radius(0.0), rules.person_speed, rules.approach, rules.margin, FARTHEST, max_age,
        rules.sidestep, rules.escape,
    )  # fmt: skip
    swift = np.minimum(limits.max_velocity, limits.max_acceleration * MOMENT)
    floats = (
        numbers, limits.max_acceleration, swift, tree.placements, tree.axes, tree.supports, capsules.ends,
        capsules.radii, far, [group.lever for group in groups], solids.shapes, solids.vertices, solids.planes,
    )  # fmt: skip
    starts = np.cumsum([0, *(len(group.pairs) for group in groups)])
    whole = tree.parents, capsules.bodies, starts, pairs, solids.index, solids.starts, solids.neighbours
    blocks = (
        np.concatenate([np.ravel(part).astype(float) for part in floats]),
        np.concatenate([sizes, *(np.ravel(part).astype(np.int64) for part in whole)]),
    )
    assert (len(blocks[0]), len(blocks[1])) == lengths(sizes[:HEADER])
    for block in blocks:
        block.flags.writeable = False
    return blocks
