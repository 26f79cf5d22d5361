"""Which joints of a model file the controller moves, and where the others are held.

A joint that is held is no joint for the controller: its bodies are fixed where its value puts them. Held are

- joints that the caller holds, at the values given;
- joints that neither turn nor slide (free, ball, planar), and those that the file locks;
- grippers: joints on several branches that move one another (mimic, joint equalities, closed loops) and carry no other;
- fingers: sliding joints that carry no other joint and hang side by side on one body.

Joints that move one another in the chain are refused by name: the controller knows only joints that move on their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from itertools import combinations
from math import isfinite
from numbers import Real
from pathlib import Path
from typing import NamedTuple

from qpsafe.errors import RobotFileError

HINGE, SLIDE = "revolute", "prismatic"
_TOLERANCE = 1e-6  # rad and m


class Coupling(NamedTuple):
    """q = own + Σ_k c_k (q_source - at)^k."""

    source: str
    coefficients: tuple[float, ...]
    own: float = 0.0
    at: float = 0.0


class FoundJoint(NamedTuple):
    """A joint of a model file.

    Attributes:
        name: Its name.
        kind: `HINGE`, `SLIDE`, or another word for what is neither.
        parent: The joint next to it on the way to the world, None if there is none.
        carrier: The body that it hangs on.
        lower, upper: Its range, infinite where it has none [rad or m].
        rest: Its value in the file's reference pose [rad or m].
        follows: What it moves with.
        loop: Number of the closed loop that it is in.
    """

    name: str
    kind: str
    parent: str | None
    carrier: str
    lower: float
    upper: float
    rest: float = 0.0
    follows: Coupling | None = None
    loop: int | None = None


class HeldJoint(NamedTuple):
    """Where a joint is held [rad, or m if it slides]."""

    value: float
    sliding: bool


class Choice(NamedTuple):
    """Values of the joints that are held (those that neither turn nor slide are not in it), and why, in words."""

    held: dict[str, float]
    notes: tuple[str, ...]


def choose_joints(
    path: Path,
    joints: Sequence[FoundJoint],
    hold: Mapping[str, float],
    units: tuple[float, float] = (1.0, 1.0),
    wanted: Set[str] = frozenset(),
) -> Choice:
    """Decide what is held.

    Args:
        path: The model file, for errors.
        joints: All its joints.
        hold: Joints that the caller holds, and where.
        units: Radians and metres in one of the units of `hold`.
        wanted: Joints that the caller wants to move.

    Raises:
        RobotFileError: `hold` is no mapping, names no joint, or has a value that is no number or out of range; a joint
            in the chain moves with another one; nothing is left.
    """
    if not isinstance(hold, Mapping):
        raise RobotFileError(path, "hold", hold, 'the values of joints by name, e.g. {"finger": 0.02} [rad or m]')
    by_name = {joint.name: joint for joint in joints}
    held = {name: _held_at(path, by_name, name, value, units) for name, value in hold.items()}
    movable = {joint.name for joint in joints if joint.kind in (HINGE, SLIDE)}
    notes = []
    other = [f"{joint.name} ({joint.kind})" for joint in joints if joint.name not in movable]
    if other:
        notes.append(f"joints that neither turn nor slide are held in place: {', '.join(other)}")
    carried = _carried(joints, movable)
    locked = [joint for joint in joints if joint.follows is not None and joint.follows.source == joint.name]
    for joint in locked:
        held.setdefault(joint.name, joint.rest)
    _follow(joints, held, {joint.name for joint in locked if joint.name not in hold})
    if locked:
        notes.append(f"joints that the file locks are held in place: {', '.join(joint.name for joint in locked)}")
    grippers = []
    for group in _groups(joints):
        free = [name for name in group if name in movable and name not in held]
        if not free:
            continue
        source = by_name[group[0]]
        beyond = [name for joint in free for name in carried[joint] if name not in group and name not in held]
        serial = all(a in carried[b] or b in carried[a] for a, b in combinations(group, 2))
        if group[0] not in held and (beyond or serial or wanted & set(free)):
            follower = next(name for name in group[::-1] if name in free)
            reason = "is in a closed loop" if source.loop is not None else f"moves with {group[0]}"
            expected = "a joint that moves on its own, or joints that are all held ([hold] in robot.toml, or hold=...)"
            raise RobotFileError(path, f"joint {follower}", reason, expected)
        for name in free:
            held.setdefault(name, by_name[name].rest)
            grippers.append(name)
    _follow(joints, held, {name for name in grippers if by_name[name].follows is not None})
    if grippers:
        notes.append(f"joints of a gripper, which move one another, are held in place: {', '.join(grippers)}")
    fingers = _fingers(joints, carried, held, wanted)
    held.update({joint.name: joint.rest for joint in fingers})
    if fingers:
        listed = ", ".join(joint.name for joint in fingers)
        notes.append(f"fingers, sliding joints side by side on one body, are held in place: {listed}")
    if not movable - set(held):
        expected = "at least one revolute or prismatic joint that is not held"
        raise RobotFileError(path, "joints", ", ".join(by_name) or 0, expected)
    return Choice(held, tuple(notes))


def _held_at(path: Path, by_name: dict[str, FoundJoint], name: str, value: float, units: tuple[float, float]) -> float:
    """The value of a joint that the caller holds [rad or m]."""
    joint = by_name.get(name)
    if joint is None or joint.kind not in (HINGE, SLIDE):
        listed = ", ".join(joint.name for joint in by_name.values() if joint.kind in (HINGE, SLIDE))
        raise RobotFileError(path, f"hold.{name}", name, f"a revolute or prismatic joint of {path.name}: {listed}")
    if not isinstance(value, Real) or isinstance(value, bool) or not isfinite(value):
        raise RobotFileError(path, f"hold.{name}", value, "a finite number [rad or m]")
    scale = units[joint.kind == SLIDE]
    if not joint.lower - _TOLERANCE <= value * scale <= joint.upper + _TOLERANCE:
        expected = f"within its range, {joint.lower / scale:g} to {joint.upper / scale:g}"
        raise RobotFileError(path, f"hold.{name}", value, expected)
    return value * scale


def _carried(joints: Sequence[FoundJoint], movable: Set[str]) -> dict[str, set[str]]:
    """The joints that each joint carries, on whatever branch."""
    parents = {joint.name: joint.parent for joint in joints}
    result: dict[str, set[str]] = {name: set() for name in parents}
    for name in movable:
        above = parents[name]
        while above is not None:
            result[above].add(name)
            above = parents[above]
    return result


def _groups(joints: Sequence[FoundJoint]) -> list[list[str]]:
    """Joints that move one another: those of a closed loop; a source, first, and all that follow it."""
    loops: dict[int, list[str]] = {}
    followers: dict[str, list[str]] = {}
    by_name = {joint.name: joint for joint in joints}
    for joint in joints:
        if joint.loop is not None:
            loops.setdefault(joint.loop, []).append(joint.name)
        if joint.follows is not None and joint.follows.source != joint.name:
            source, seen = joint.follows.source, {joint.name}
            while source not in seen and (above := by_name[source].follows) is not None:
                seen.add(source)
                source = above.source
            followers.setdefault(source, []).append(joint.name)
    groups = [*loops.values()]
    groups += [[source, *(name for name in names if name != source)] for source, names in followers.items()]
    return groups


def _follow(joints: Sequence[FoundJoint], held: dict[str, float], which: Set[str]) -> None:
    """Put the held joints of `which` where what they follow puts them."""
    for _ in which:  # a follower may follow a follower
        for joint in joints:
            if joint.name in which and joint.follows is not None and joint.follows.source in held:
                coupling = joint.follows
                moved = held[coupling.source] - coupling.at
                held[joint.name] = coupling.own + sum(c * moved**k for k, c in enumerate(coupling.coefficients))


def _fingers(
    joints: Sequence[FoundJoint], carried: dict[str, set[str]], held: Mapping[str, float], wanted: Set[str]
) -> list[FoundJoint]:
    ends = [joint for joint in joints if joint.kind == SLIDE and not carried[joint.name] and joint.name not in held]
    carriers = [joint.carrier for joint in ends]
    return [joint for joint in ends if carriers.count(joint.carrier) > 1 and joint.name not in wanted]
