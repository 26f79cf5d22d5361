"""Smallest true distance along a path, of the robot to what stands in its cell and to itself, by collision hulls.

The distance is measured at every moment of the path. Between two of them, at distances a and b, it is at least
(a + b - L)/2, with L a bound on how far the shapes travel meanwhile. Where that may be less than the smallest distance
found, the step is cut in half, and again, until the smallest distance is known to `EXACT`, or something touches:
nothing thin is stepped over.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.geometry.layout import BALL, BODY
from qpsafe.geometry.measure import Nearest, nearest_of

if TYPE_CHECKING:
    from qpsafe.check.path import NominalPath
    from qpsafe.geometry.solids import Solids
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]
Index = NDArray[np.int64]

EXACT = 5e-4  # how well the smallest distance is known [m]


class Gap(NamedTuple):
    """Where a path has its smallest distance.

    Attributes:
        distance: It; negative where the two overlap [m].
        time: When [s].
        shape: Name of the robot's shape.
        joint: Name of the joint that moves it; empty for the base.
        other: Name of what it is near to.
        on_robot: Nearest point on the robot, world frame (3,) [m].
        on_other: Nearest point on the other (3,) [m].
    """

    distance: float
    time: float
    shape: str
    joint: str
    other: str
    on_robot: Array
    on_other: Array


def smallest_gap(robot: Robot, path: NominalPath, solids: Solids, pairs: Index) -> tuple[Gap | None, Array]:
    """The smallest distance on a path, None if there is nothing to measure, and that of every moment (N,) [m].

    Args:
        robot: The robot.
        path: Where it goes.
        solids: What there is.
        pairs: Which shapes are measured against which, (m, 2).
    """
    count = len(path.times)
    if not count or not len(pairs):
        return None, np.full(count, np.inf)

    def at(q: Array) -> Nearest:
        return nearest_of(solids.solid, robot.at(q).body_poses(), pairs)

    found = [nearest_of(solids.solid, poses, pairs) for poses in path.poses]
    distances = np.array([nearest.distance for nearest in found])
    k = int(distances.argmin())
    best, time = found[k], float(path.times[k])

    bounds = 0.5 * (distances[:-1] + distances[1:] - travels(robot, path, solids, pairs))
    steps = [
        (float(bound), float(i), float(i + 1), float(distances[i]), float(distances[i + 1]))
        for i, bound in enumerate(bounds)
        if bound < best.distance - EXACT
    ]
    heapify(steps)
    while steps and best.distance > 0.0 and steps[0][0] < best.distance - EXACT:
        bound, start, end, before, after = heappop(steps)
        middle = 0.5 * (start + end)
        i = int(start)
        q = path.q[i] + (middle - i) * (path.q[i + 1] - path.q[i])
        nearest = at(q)
        if nearest.distance < best.distance:
            best, time = nearest, float(np.interp(middle, np.arange(count), path.times))
        travel = 0.5 * (before + after - 2.0 * bound)  # of half the step
        heappush(steps, (0.5 * (before + nearest.distance - travel), start, middle, before, nearest.distance))
        heappush(steps, (0.5 * (nearest.distance + after - travel), middle, end, nearest.distance, after))
    body = int(solids.index[best.shape, BODY])
    names = solids.names[best.shape], robot.joint_names[body - 1] if body else "", solids.names[best.other]
    return Gap(best.distance, time, *names, best.on_robot, best.on_other), distances


def travels(robot: Robot, path: NominalPath, solids: Solids, pairs: Index) -> Array:
    """How much nearer the shapes of any pair can come in each step of a path, at most (N - 1,) [m].

    Only joints that move one of the two, but not the other, change their distance. A point at the distance ρ_j from the
    axis of joint j moves by |Δq_j| ρ_j with it, and ρ_j changes by no more than the travel L of the shape itself:
    L <= Σ_j |Δq_j| (ρ_j + L). Where joint j slides, it moves the point by |Δq_j|. In a step of a path that keeps to the
    joints' speeds, Σ_j |Δq_j| is far below 1.

    Args:
        robot: The robot.
        path: Where it goes; its joints move evenly in a step.
        solids: What there is.
        pairs: Which shapes are measured against which, (m, 2).
    """
    dq, poses, bodies = np.abs(np.diff(path.q, axis=0)), path.poses[:-1], solids.index[:, BODY]
    alike = np.where(bodies == 0, int(np.flatnonzero(bodies == 0).min(initial=len(bodies))), np.arange(len(bodies)))
    pairs = np.unique(alike[pairs], axis=0)  # of what no joint moves one is as good as the other
    largest = np.zeros(len(dq))
    for pair in pairs:
        total = np.zeros(len(dq))
        for shape, other in (pair, pair[::-1]):
            body, ball, supports = bodies[shape], solids.shapes[shape, BALL : BALL + 4], robot.tree.supports
            centres = poses[:, body, :3, :3] @ ball[:3] + poses[:, body, :3, 3]
            moved, turned = np.zeros(len(dq)), np.zeros(len(dq))
            for j in np.flatnonzero(supports[body] > supports[bodies[other]]):
                arm = np.linalg.norm(centres - poses[:, j + 1, :3, 3], axis=1) + ball[3]
                moved += dq[:, j] * (1.0 if robot.sliding[j] else arm)
                turned += dq[:, j] * (not robot.sliding[j])
            total += moved / np.maximum(1.0 - turned, 0.1)
        np.maximum(largest, total, out=largest)
    return largest
