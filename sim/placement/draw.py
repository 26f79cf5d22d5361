"""Random pairs of a robot configuration and a dummy, section V-C: all feasible pairs are equally likely.

A pair is drawn again until the robot touches neither itself nor the ground and the dummy neither the robot nor the
pedestal. Each pair has a random generator of its own, made from the seed, the sample's number and the pair's number:
what is drawn does not depend on how pairs are shared out among workers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.placement.dummy import DRAWS, dummies

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.placement.world import PlacementWorld

Array = NDArray[np.float64]

MOST_TRIES = 2000  # of one pair


def workspace_radius(robot: Robot, configurations: int = 2000) -> float:
    """How far from the base axis the wire reaches: the largest distance over random configurations [m]."""
    rng = np.random.default_rng(0)
    rest = np.zeros(robot.nq)
    largest = 0.0
    for q in rng.uniform(robot.lower, robot.upper, (configurations, robot.nq)):
        wire = robot.wire(q, rest)
        largest = max(largest, float(np.hypot(wire.ends[:, 0], wire.ends[:, 1]).max()))
    return largest


def draw_pairs(world: PlacementWorld, seed: int, sample: int, pairs: range, radius: float) -> tuple[Array, Array]:
    """The pairs of a sample with the given numbers.

    Args:
        world: For the contacts.
        seed: Of everything random.
        sample: Number of the sample; samples are independent of each other.
        pairs: Numbers of the pairs, k of them.
        radius: Of the disc that dummies stand in [m].

    Returns:
        Configurations (k, n) [rad] and the dummies' capsules (k, 17, 2, 3) [m].

    Raises:
        ConfigurationError: A pair is infeasible every time: the robot's shapes overlap, or there is no room.
    """
    robot, n = world.robot, world.robot.nq
    sources = [np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(sample, i)))) for i in pairs]
    q, capsules = np.empty((len(sources), n)), np.empty((len(sources), 17, 2, 3))
    waiting = np.arange(len(sources))
    for _ in range(MOST_TRIES):
        draws = np.array([sources[i].random(n + DRAWS) for i in waiting])
        q[waiting] = robot.lower + draws[:, :n] * (robot.upper - robot.lower)
        capsules[waiting] = dummies(draws[:, n:], radius, -world.pedestal)
        waiting = waiting[[not world.feasible(q[i], capsules[i]) for i in waiting]]
        if not len(waiting):
            return q, capsules
    expected = "a robot whose collision shapes leave room for itself and for a person in its workspace"
    raise ConfigurationError(robot.model_path, "random pairs", f"{MOST_TRIES} infeasible in a row", expected)
