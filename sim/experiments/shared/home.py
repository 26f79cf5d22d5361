"""A home posture for an arm whose file states none: in front of it, tool down, away from limits and singular poses."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, NamedTuple

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

Array = NDArray[np.float64]

#: Where the tool may be, from the shoulder, in shares of the arm's length: ahead, and up; the first is the IRB 140's.
PLACES = tuple(product((0.5, 0.6, 0.4), (0.2, 0.0, 0.35, -0.2)))
YAWS = np.radians((0.0, 90.0, -90.0, 180.0))  # of the tool about the vertical
GUESSES = 6  # from which each pose is looked for
LOW = 0.1  # links beyond the shoulder end above that: the pedestal is in their way else [m]
GOOD = 0.12  # a posture that is better than that is taken at once; the IRB 140's home has 0.13
SINGLE = 2000  # postures that are drawn where there are fewer than six joints


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
    def of(cls, robot: Robot, tool: str | None = None) -> Arm:
        """The arm of a tool, the first by default."""
        tool = tool or robot.tool_frames[0]
        body = robot.mounting(tool)[0]
        joints = np.flatnonzero(robot.tree.supports[body]).tolist()
        state = robot.at(robot.home)
        poses = state.body_poses()
        origins = np.array([poses[j + 1][:3, 3] for j in joints[1:] or joints] + [state.position(tool)])
        return cls(tool, tuple(joints), origins[0], float(np.linalg.norm(np.diff(origins, axis=0), axis=1).sum()))


def chosen_home(robot: Robot) -> Array:
    """Joint positions (n,) [rad] of a posture from which the arm can work.

    The tool is ahead of the shoulder and points down, if six joints or more carry it; with fewer, the best of many
    postures at random whose tool is about there. Judged by `quality`, among those in which fewest links touch or hang
    down.
    """
    arm, rng = Arm.of(robot), np.random.default_rng(0)
    touching = Touching(robot)
    found: list[tuple[int, float, Array]] = []
    if len(arm.joints) < 6:
        for q in _drawn(robot, rng, SINGLE):
            off = (robot.at(q).position(arm.tool) - arm.shoulder) / max(arm.length, 1e-9)
            found.append((0, quality(robot, arm, q) - float(np.linalg.norm(off - (0.5, 0.0, 0.2))), q))
        best = sorted(found, key=lambda item: -item[1])[:20]
        return min(((touching(q), -worth, tuple(q)) for _, worth, q in best), key=lambda item: item[:2])[2]  # type: ignore[return-value]
    axis = tool_axis(robot, arm.tool)
    down = turned_to(axis, np.array([0.0, 0.0, -1.0]))
    moving = {j + 1 for j in arm.joints[1:]}
    beyond = [k for k, (start, _) in enumerate(robot.wire_frames) if robot.mounting(start)[0] in moving]
    guesses = [robot.home, *_drawn(robot, rng, GUESSES - 1)]
    for ahead, up in PLACES:
        pose = np.eye(4)
        pose[:3, 3] = arm.shoulder + arm.length * np.array((ahead, 0.0, up))
        for yaw in YAWS:
            pose[:3, :3] = exp3(np.array((0.0, 0.0, yaw))) @ down
            for guess in guesses:
                try:
                    q = joints_for(robot, arm.tool, pose, guess, steps=60)
                except UnreachableError:
                    continue
                q = robot.nearest(q, np.zeros(robot.nq))
                low = int((robot.wire(q, 0.0 * q).ends[beyond, 2] < LOW).sum())
                found.append((touching(q) + low, -quality(robot, arm, q), q))
        if any(trouble == 0 and -worth > GOOD for trouble, worth, _ in found):
            break
    return min(found, key=lambda item: item[:2])[2] if found else robot.home.copy()


def quality(robot: Robot, arm: Arm, q: Array) -> float:
    """How far a posture is from singular poses and from limits: the smaller of two shares.

    The smallest singular value of the tool's Jacobian, lengths in the arm's; a joint's distance from its nearer limit,
    of a third of its range.

    Args:
        robot: The robot.
        arm: Which of its arms.
        q: The posture (n,) [rad].
    """
    J = robot.jacobian(arm.tool, q)[:, list(arm.joints)].copy()
    J[:3] /= max(arm.length, 1e-9)
    rows = J if len(arm.joints) >= 6 else J[:3]
    value = float(np.linalg.svd(rows, compute_uv=False)[-1])
    margins = np.minimum(q - robot.lower, robot.upper - q) / (robot.upper - robot.lower)
    return min(value, float(3.0 * margins[list(arm.joints)].min()))


def _drawn(robot: Robot, rng: np.random.Generator, count: int) -> list[Array]:
    """Postures at random, those of joints that turn far within half a turn."""
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    low, high = np.where(low < high, low, robot.lower), np.where(low < high, high, robot.upper)
    return list(rng.uniform(low, high, (count, robot.nq)))


class Touching:
    """Counts pairs of the robot's own shapes that touch in a posture; those on the same or on joined bodies may."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._solids = robot, Solids.of(robot)
        bodies, parents = self._solids.index[:, BODY], [0, *robot.tree.parents.tolist()]
        numbers = self._solids.robot.tolist()
        self._pairs = [
            pairs_of([(i, j)])
            for k, i in enumerate(numbers)
            for j in numbers[:k]
            if bodies[i] != bodies[j] and parents[bodies[i]] != bodies[j] and parents[bodies[j]] != bodies[i]
        ]

    def __call__(self, q: Array) -> int:
        """How many at q (n,)."""
        poses, solid = self._robot.at(q).body_poses(), self._solids.solid
        return sum(not nearest_of(solid, poses, pair, 1e-3).distance > 0.0 for pair in self._pairs)
