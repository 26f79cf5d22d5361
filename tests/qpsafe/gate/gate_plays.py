"""Robots under random commands among walking people and obstacles: what the gate promises is counted by other means."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from qpsafe.gate.gate import Gate
from qpsafe.gate.gated import NO_AGES
from qpsafe.gate.pack import robot_capsules
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.geometry.measure import nearest_of
from qpsafe.limits import JointLimits
from qpsafe.robot.robot import Robot
from qpsafe.sensing.hulls import Obstacle

Array = NDArray[np.float64]
DT = 0.004


@dataclass
class Play:
    """What a play came to.

    Attributes:
        approach: Fastest approach of a link to a seen point that it could touch [m/s].
        short: Ticks in which braking itself approached somebody too fast.
        solids: Smallest distance to furniture and itself at the end of a tick [m].
        start: The same at the beginning.
        excess: By how much a command left the box of the limits [rad/s].
        held: Ticks in which not all was let through.
        retreats: Of the ticks that were short, whether the approach was no faster than that of braking.
    """

    approach: float = 0.0
    short: int = 0
    solids: float = np.inf
    start: float = np.inf
    excess: float = 0.0
    held: int = 0
    retreats: list[bool] = field(default_factory=list)

    def kept_clear(self, margin: float) -> bool:
        """Whether nothing came nearer than the margin, or than it was at first."""
        return self.solids >= min(margin, self.start) - 1e-5


def to_axes(robot: Robot, q: Array, points: Array) -> Array:
    """Distances of points from the capsules' axes (c, p), by pinocchio's kinematics [m]."""
    capsules = robot_capsules(robot)
    poses = robot.at(q).body_poses()[capsules.bodies]
    ends = np.einsum("cij,csj->csi", poses[:, :3, :3], capsules.ends) + poses[:, None, :3, 3]
    d = ends[:, 1] - ends[:, 0]
    along = np.einsum("cpi,ci->cp", points[None] - ends[:, :1], d)
    dd = np.maximum((d * d).sum(axis=1), 1e-300)[:, None]
    foot = ends[:, :1] + np.clip(along / dd, 0.0, 1.0)[:, :, None] * d[:, None]
    return np.linalg.norm(points[None] - foot, axis=2)


def obstacles(robot: Robot, rng: np.random.Generator) -> list[Obstacle]:
    """A floor below, and boxes around the robot, none of which it touches at home."""
    wire = robot.wire(robot.home, np.zeros(robot.nq))
    low = min(wire.starts[:, 2].min(), wire.ends[:, 2].min())
    found = [Obstacle.box("floor", (6.0, 6.0, 0.5), (0.0, 0.0, low - 0.9))]
    for k in range(4):
        centre = rng.uniform((-0.9, -0.9, low), (0.9, 0.9, low + 1.2))
        found.append(Obstacle.box(f"box {k}", rng.uniform(0.05, 0.4, 3), centre))
    return found


def play(
    robot: Robot, seed: int, ticks: int, *, people: int = 2, fastest: float = 1.6, appear: bool = False,
    rules: VerifiedMotion | None = None, look: int = 1,
) -> Play:  # fmt: skip
    """Random commands, changed every few ticks, at full acceleration, through the gate.

    Args:
        robot: The robot.
        seed: Of everything.
        ticks: How many.
        people: Points that walk towards places near the robot and away again.
        fastest: How fast they walk [m/s].
        appear: Whether they may appear at once near the robot.
        rules: Figures of the gate.
        look: Ticks between two looks at the solids.
    """
    rng = np.random.default_rng(seed)
    limits, rules = JointLimits.of(robot, DT), VerifiedMotion() if rules is None else rules
    gate = Gate(robot, rules, limits, obstacles(robot, rng))
    pairs = np.vstack([group.pairs for group in gate.groups])
    radii = robot_capsules(robot).radii[:, None]
    q, qd, told = np.array(robot.home), np.zeros(robot.nq), Play()
    seen = rng.normal(size=(people, 3))
    seen = 4.0 * seen / np.linalg.norm(seen, axis=1)[:, None]
    goals, paces = rng.uniform(-0.8, 0.8, (people, 3)), rng.uniform(0.3, 1.0, people) * fastest
    reach = rules.radius(DT)
    told.start = told.solids = nearest_of(gate.solids.solid, robot.at(q).body_poses(), pairs).distance
    for tick in range(ticks):
        if tick % 40 == 0:
            wanted = rng.normal(size=robot.nq) * robot.max_velocity * rng.choice([0.1, 0.4, 1.0])
        if tick % 150 == 0:
            goals = rng.uniform(-0.8, 0.8, (people, 3)) + rng.choice([0.0, 3.0])
            paces = rng.uniform(0.3, 1.0, people) * fastest
            if appear:
                seen = rng.uniform(-0.8, 0.8, (people, 3))
        box = limits.box(q, qd)
        command = box.clip(wanted)
        gated = gate(q, qd, command, np.ascontiguousarray(seen), NO_AGES)
        told.excess = max(told.excess, float((command - box.upper).max()), float((box.lower - command).max()))
        told.held += gated.share < 1.0
        before, after = to_axes(robot, q, seen), to_axes(robot, q + command * DT, seen)
        could = np.minimum(before, after) - radii < reach
        towards = (before - after) / DT
        if gated.short > 0.0:
            told.short += 1
            braking = qd - np.clip(qd, -limits.max_acceleration * DT, limits.max_acceleration * DT)
            told.retreats.append(bool(np.allclose(command, braking, atol=1e-12)) or gated.share == 1.0)
        elif could.any():
            told.approach = max(told.approach, float(towards[could].max()))
        q, qd = q + command * DT, command
        if tick % look == 0:
            found = nearest_of(gate.solids.solid, robot.at(q).body_poses(), pairs, 0.2)
            told.solids = min(told.solids, found.distance)
        away = goals - seen
        length = np.linalg.norm(away, axis=1)
        step = np.minimum(paces * DT, length) / np.maximum(length, 1e-12)
        seen = seen + away * step[:, None]
    return told
