"""The point nearest to a hand's goal that it can reach without a step."""

from __future__ import annotations

import math

import numpy as np

from qpsafe.sim.people.anatomy import Body
from qpsafe.sim.people.person import Person
from qpsafe.sim.people.posture import HANG, Point
from qpsafe.sim.people.walker import Root

SPARE = 2e-3  # nearer than the arm is long [m]
LOW = 0.3  # hands go no lower above the floor [m]
TRIES = 12


def within_reach(height: float, floor: float, root: Root, point: Point, left: bool) -> Point:
    """The point itself if the hand gets there, else what is nearest to it on the line to the shoulder, stooping.

    Args:
        height: Of the body [m].
        floor: Height of the floor [m].
        root: Where they stand: x, y [m], heading [rad].
        point: Where the hand wants to be, world frame [m].
        left: Whether it is the left one.
    """
    person, (x, y, heading) = Person(floor, None, Body.of_height(height)), root
    c, s, side = math.cos(heading), math.sin(heading), 0 if left else 1
    dx, dy = point[0] - x, point[1] - y
    goal = np.array([c * dx + s * dy, c * dy - s * dx, max(point[2] - floor, LOW)])
    for _ in range(TRIES):
        goals: list[Point | str] = [HANG, HANG]
        goals[side] = (float(goal[0]), float(goal[1]), float(goal[2]))
        stoop, lack = person.least_stoop(goals)
        if lack <= 0.0:
            break
        line = person.shoulders(stoop)[side] - goal
        goal = goal + (lack + SPARE) / float(np.linalg.norm(line)) * line
    ahead, aside, up = goal.tolist()
    return x + c * ahead - s * aside, y + s * ahead + c * aside, up + floor
