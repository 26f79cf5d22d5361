"""A home posture for arms whose file states none: in front of them, tools down, away from limits and singular poses."""

from __future__ import annotations

from collections.abc import Callable, Set
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.geometry.layout import BODY
from qpsafe.geometry.measure import nearest_of, pairs_of
from qpsafe.geometry.solids import Solids
from qpsafe.sim.world.tool_axis import tool_axis, turned_to
from qpsafe.tasks.reach import UnreachableError, joints_for
from qpsafe.tasks.rotation import exp3

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState

Array = NDArray[np.float64]

#: Where the tool may be, from the shoulder, in shares of the arm's length: ahead, and up; the first is the IRB 140's.
PLACES = tuple(product((0.5, 0.6, 0.4), (0.2, 0.0, 0.35, -0.2)))
YAWS = np.radians((0.0, 90.0, -90.0, 180.0))  # of the tool about the vertical
GUESSES = 6  # from which each pose is looked for
LOW = 0.1  # links beyond the shoulder end above that: the pedestal is in their way else [m]
GOOD = 0.12  # a posture that is better than that is taken at once; the IRB 140's home has 0.13
FEWEST = 3  # joints of what is an arm; of a neck, nothing is promised
SINGLE = 2000  # postures that are drawn where there are fewer than six joints
#: What a home posture should be at least: tool so far ahead of the shoulder, in arm lengths; so near to pointing down;
#: so far from singular poses, and from limits, in the measures of `quality`.
AHEAD, DOWN, CLEAR = 0.25, np.radians(5.0), 0.02
#: Counts links that touch in a posture (n,).
Count = Callable[[Array], int]


class Arm(NamedTuple):
    """One arm: what moves a tool.

    Attributes:
        tool: Frame at its tip.
        joints: Their places among the robot's, base to tip.
        shoulder: Origin of its second joint, where the robot's home has it (3,) [m].
        length: From there to the tool along the joints' origins [m].
    """

    tool: str
    joints: tuple[int, ...]
    shoulder: Array
    length: float

    @classmethod
    def of(cls, robot: Robot, tool: str | None = None, q: Array | None = None) -> Arm:
        """The arm of a tool.

        Args:
            robot: The robot.
            tool: Frame at its tip; the first tool by default.
            q: Where its shoulder and its length are measured (n,) [rad]; home by default.
        """
        tool = tool or robot.tool_frames[0]
        body = robot.mounting(tool)[0]
        joints = np.flatnonzero(robot.tree.supports[body]).tolist()
        state = robot.at(robot.home if q is None else q)
        poses = state.body_poses()
        origins = np.array([poses[j + 1][:3, 3] for j in joints[1:] or joints] + [state.position(tool)])
        return cls(tool, tuple(joints), origins[0], float(np.linalg.norm(np.diff(origins, axis=0), axis=1).sum()))


class Home(NamedTuple):
    """A home posture that was chosen.

    Attributes:
        q: Joint positions (n,) [rad].
        missed: What it should be and is not, in words.
    """

    q: Array
    missed: tuple[str, ...]


def chosen_home(robot: Robot) -> Home:
    """A posture from which every arm can work.

    A tool is ahead of its shoulder and points down, if six joints or more carry it and can do that; else the best of
    many postures at random whose tool is about there. Judged by `quality`, among those in which fewest links touch or
    hang down. One arm after the other, each with all other joints where they are.
    """
    rng, touching, q = np.random.default_rng(0), Touching(robot), robot.home.copy()
    arms = [Arm.of(robot, tool) for tool in robot.tool_frames]
    parts = [_own(arms, k) for k in range(len(arms))]
    for k, own in enumerate(parts):
        arm, later = Arm.of(robot, arms[k].tool, q), {j + 1 for part in parts[k + 1 :] for j in part}
        given = robot, arm, own, q, rng, partial(touching, without=later)
        found = _down(*given) if len(own) >= 6 else None
        q = _about(*given) if found is None else found
    return Home(q, shortcomings(robot, q, touching))


def _own(arms: list[Arm], k: int) -> list[int]:
    """The joints that are chosen for an arm: its own, as six of them do; else also those it shares, if it is first."""
    others = {joint for i, arm in enumerate(arms) for joint in arm.joints if i != k}
    own = [joint for joint in arms[k].joints if joint not in others]
    before = {joint for arm in arms[:k] for joint in arm.joints}
    return own if len(own) >= 6 else [joint for joint in arms[k].joints if joint not in before]


def _about(robot: Robot, arm: Arm, own: list[int], start: Array, rng: np.random.Generator, touching: Count) -> Array:
    """The best of many postures at random whose tool is about where it should be.

    Args:
        robot: The robot.
        arm: For which.
        own: Joints that are chosen.
        start: Where all others are (n,) [rad].
        rng: Draws.
        touching: Counts links that touch.
    """
    found = []
    for q in _drawn(robot, rng, SINGLE, own, start) if own else [start]:
        off = (robot.at(q).position(arm.tool) - arm.shoulder) / max(arm.length, 1e-9)
        found.append((quality(robot, arm, q) - float(np.linalg.norm(off - (0.5, 0.0, 0.2))), q))
    best = sorted(found, key=lambda item: -item[0])[:20]
    return min(((touching(q), -worth, q) for worth, q in best), key=lambda item: item[:2])[2]


def _down(
    robot: Robot, arm: Arm, own: list[int], start: Array, rng: np.random.Generator, touching: Count
) -> Array | None:
    """The best posture with the tool ahead and down; None if there is none.

    Args:
        robot: The robot.
        arm: For which.
        own: Joints that are chosen.
        start: Where all others are (n,) [rad].
        rng: Draws.
        touching: Counts links that touch.
    """
    down = turned_to(tool_axis(robot, arm.tool), np.array([0.0, 0.0, -1.0]))
    moving = {j + 1 for j in arm.joints[1:]}
    beyond = [k for k, (start, _) in enumerate(robot.wire_frames) if robot.mounting(start)[0] in moving]
    guesses, found = [start, *_drawn(robot, rng, GUESSES - 1, own, start)], list[tuple[int, float, Array]]()
    part: Any = robot if len(own) == len(arm.joints) else _Part(robot, own)
    for ahead, up in PLACES:
        pose = np.eye(4)
        pose[:3, 3] = arm.shoulder + arm.length * np.array((ahead, 0.0, up))
        for yaw in YAWS:
            pose[:3, :3] = exp3(np.array((0.0, 0.0, yaw))) @ down
            for guess in guesses:
                try:
                    q = joints_for(part, arm.tool, pose, guess, steps=60)
                except UnreachableError:
                    continue
                q[own] = robot.nearest(q, np.zeros(robot.nq))[own]
                low = int((robot.wire(q, 0.0 * q).ends[beyond, 2] < LOW).sum())
                found.append((touching(q) + low, -quality(robot, arm, q), q))
        if any(trouble == 0 and -worth > GOOD for trouble, worth, _ in found):
            break
    return min(found, key=lambda item: item[:2])[2] if found else None


class _Part:
    """A robot of which some joints move, for `joints_for`: the others do not help to get anywhere."""

    def __init__(self, robot: Robot, own: list[int]) -> None:
        self._robot, self._own = robot, own
        self.lower, self.upper, self.joint_names = robot.lower, robot.upper, robot.joint_names

    def at(self, q: Array) -> _Part:
        """At q (n,) [rad]."""
        self._state: RobotState = self._robot.at(q)
        return self

    def pose(self, frame: str) -> Array:
        """Of a frame (4, 4) [m]."""
        return self._state.pose(frame)

    def jacobian(self, frame: str) -> Array:
        """Of a frame (6, n), zero for joints that stay."""
        whole = self._state.jacobian(frame)
        found = np.zeros_like(whole)
        found[:, self._own] = whole[:, self._own]
        return found


def shortcomings(robot: Robot, q: Array, touching: Touching | None = None) -> tuple[str, ...]:
    """What a home posture should be and is not, in words: nothing for a good one.

    Args:
        robot: The robot.
        q: The posture (n,) [rad].
        touching: Of the robot, if it is at hand.
    """
    said, state = list[str](), robot.at(q)
    arms = [arm for arm in (Arm.of(robot, tool, q) for tool in robot.tool_frames) if len(arm.joints) >= FEWEST]
    for arm in arms:
        pose = state.pose(arm.tool)
        ahead = float(pose[0, 3] - arm.shoulder[0]) / max(arm.length, 1e-9)
        if not ahead >= AHEAD:
            said.append(f"{arm.tool} is {100 * ahead:.0f} % of the arm's length ahead of its shoulder")
        off = float(np.arccos(np.clip(-(pose[:3, :3] @ tool_axis(robot, arm.tool))[2], -1.0, 1.0)))
        if not off <= DOWN:
            said.append(f"{arm.tool} looks off down by {np.degrees(off):.0f} deg")
        if not _dexterity(robot, arm, q) >= CLEAR:
            said.append(f"{arm.tool} is near a singular pose")
    margins = _margins(robot, q)
    at_limit = {joint for arm in arms for joint in arm.joints if not margins[joint] >= CLEAR}
    if at_limit:
        said.append("near a limit: " + ", ".join(robot.joint_names[joint] for joint in sorted(at_limit)))
    pairs = (touching or Touching(robot)).pairs(q)
    if pairs:
        names = ["the base", *robot.joint_names]
        said.append("links touch: " + ", ".join(f"{names[a]} and {names[b]}" for a, b in pairs))
    return tuple(said)


def quality(robot: Robot, arm: Arm, q: Array) -> float:
    """How far a posture is from singular poses and from limits: the smaller of two shares.

    The smallest singular value of the tool's Jacobian, lengths in the arm's; a joint's distance from its nearer limit,
    of a third of its range.

    Args:
        robot: The robot.
        arm: Which of its arms.
        q: The posture (n,) [rad].
    """
    return min(_dexterity(robot, arm, q), float(_margins(robot, q)[list(arm.joints)].min()))


def _dexterity(robot: Robot, arm: Arm, q: Array) -> float:
    """The smallest singular value of a tool's Jacobian, lengths in the arm's."""
    J = robot.jacobian(arm.tool, q)[:, list(arm.joints)].copy()
    J[:3] /= max(arm.length, 1e-9)
    rows = J if len(arm.joints) >= 6 else J[:3]
    return float(np.linalg.svd(rows, compute_uv=False)[-1])


def _margins(robot: Robot, q: Array) -> Array:
    """Every joint's distance from its nearer limit, of a third of its range (n,)."""
    return 3.0 * (np.minimum(q - robot.lower, robot.upper - q) / (robot.upper - robot.lower))


def _drawn(robot: Robot, rng: np.random.Generator, count: int, own: list[int], start: Array) -> list[Array]:
    """Postures at random of some joints, those that turn far within half a turn.

    Args:
        robot: The robot.
        rng: Draws.
        count: How many.
        own: These joints.
        start: Where all others are (n,) [rad].
    """
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    low, high = np.where(low < high, low, robot.lower), np.where(low < high, high, robot.upper)
    found = np.repeat(start[None], count, axis=0)
    found[:, own] = rng.uniform(low, high, (count, robot.nq))[:, own]
    return list(found)


class Touching:
    """Counts pairs of the robot's own shapes that touch in a posture; those on the same or on joined bodies may."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._solids = robot, Solids.of(robot)
        bodies, parents = self._solids.index[:, BODY], [0, *robot.tree.parents.tolist()]
        numbers = self._solids.robot.tolist()
        self._pairs = [
            (pairs_of([(i, j)]), (int(bodies[j]), int(bodies[i])))
            for k, i in enumerate(numbers)
            for j in numbers[:k]
            if bodies[i] != bodies[j] and parents[bodies[i]] != bodies[j] and parents[bodies[j]] != bodies[i]
        ]

    def __call__(self, q: Array, without: Set[int] = frozenset()) -> int:
        """How many at q (n,), those of some bodies left out."""
        return len(self._found(q, without))

    def pairs(self, q: Array) -> list[tuple[int, int]]:
        """Bodies that touch at q (n,), 0 for the base."""
        return sorted(set(self._found(q)))

    def _found(self, q: Array, without: Set[int] = frozenset()) -> list[tuple[int, int]]:
        poses, solid = self._robot.at(q).body_poses(), self._solids.solid
        return [
            bodies
            for pair, bodies in self._pairs
            if without.isdisjoint(bodies) and not nearest_of(solid, poses, pair, 1e-3).distance > 0.0
        ]
