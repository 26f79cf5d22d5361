"""One piece of the Monte Carlo simulation: pairs drawn, rays cast, danger computed. What a worker does."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco.batch
import numpy as np

from qpsafe.danger.field import DangerField, danger_vectors
from qpsafe.placement.peak import peak_field
from qpsafe.placement.sample import Detections
from qpsafe.robot.loader import load_robot
from qpsafe.sensing.spots import SpotArray, rays_in_world
from qpsafe.sim.placement.draw import draw_pairs
from qpsafe.sim.placement.dummy import RADII
from qpsafe.sim.placement.world import PlacementWorld

CHUNK = 256  # pairs of a piece; a multiple of 8


@dataclass(frozen=True, eq=False)
class Setup:
    """What workers need to know; small, and can be pickled.

    Attributes:
        robot: What `load_robot` finds the robot by; on other machines there must be the same file.
        nodes: The candidate nodes.
        seed: Of everything random.
        radius: Of the disc that dummies stand in [m].
        pedestal: Height of the robot's base above the floor [m].
    """

    robot: str | Path
    nodes: SpotArray
    seed: int
    radius: float
    pedestal: float

    @cached_property
    def key(self) -> tuple[Any, ...]:
        """Equal for equal set-ups."""
        nodes = self.nodes
        arrays = (nodes.positions, nodes.directions, nodes.links, nodes.range_min, nodes.range_max)
        return (str(self.robot), self.pedestal, nodes.frames, *(array.tobytes() for array in arrays))


class _Caster:
    """The world and the rays of a set-up, for one thread."""

    def __init__(self, setup: Setup) -> None:
        robot = load_robot(setup.robot)
        self.world = PlacementWorld(robot, setup.pedestal)
        self.bodies, self.rays = setup.nodes.mounting(robot)
        self.own = self.world.bodies_of(setup.nodes)
        # One thread: the rest of a piece runs in one too, and pieces run side by side.
        self.batch = mujoco.batch.Batch(self.world.model, CHUNK, nthread=1)


_local = threading.local()


def _caster(setup: Setup) -> _Caster:
    """The thread's caster, made anew when the set-up changes."""
    if getattr(_local, "key", None) != setup.key:
        _local.caster, _local.key = _Caster(setup), setup.key
    caster: _Caster = _local.caster
    return caster


def cast_pairs(setup: Setup, sample: int, first: int, count: int) -> Detections:
    """Detections of the pairs first to first + count - 1 of a sample, count <= CHUNK.

    A ray that meets the robot, the pedestal or the floor first detects nothing, nor does one that meets the dummy
    nearer than the sensor's range: the sensor reads it as farther away.

    Args:
        setup: The study's.
        sample: Which one.
        first: Number of the first pair.
        count: How many.
    """
    caster, nodes = _caster(setup), setup.nodes
    world = caster.world
    q, capsules = draw_pairs(world, setup.seed, sample, range(first, first + count), setup.radius)
    links, k = len(world.robot.wire_frames), len(nodes)
    origins, directions = np.empty((count, k, 3)), np.empty((count, k, 3))
    starts, ends = np.empty((count, links, 3)), np.empty((count, links, 3))
    rest, wires, arms = np.zeros(world.robot.nq), [], []
    first_end, second_end = world.robot.wire_indices
    for p in range(count):
        state = world.robot.at(q[p])
        origins[p], directions[p] = rays_in_world(state.body_poses(), caster.bodies, caster.rays)
        wires.append(state.wire(rest))
        starts[p], ends[p] = wires[-1].starts, wires[-1].ends
        jacobians = state.wire_jacobians()
        arms.append(jacobians[first_end] + jacobians[second_end])  # (links, 3, n)
    distance, dummy, robot = world.cast(caster.batch, q, capsules, origins, directions, caster.own)
    within = distance <= nodes.range_max
    detected = dummy & within & (distance >= nodes.range_min)
    points = origins + np.where(detected, distance, 0.0)[..., None] * directions  # eq. (7)
    field, danger, torque = DangerField(static=1.0, kinetic=0.0), [], []
    for p, (wire, arm) in enumerate(zip(wires, arms, strict=True)):
        value, gradient = field.evaluate(points[p][detected[p]], wire)
        danger.append(value)  # eq. (9)
        force = danger_vectors(value, gradient)
        sigma = np.einsum("dxj,dx->dj", arm[nodes.links[detected[p]]], force)  # eqs. (14), (15) of this detection alone
        torque.append(np.linalg.norm(sigma, axis=1))
    return Detections(
        counts=detected.sum(axis=1),
        nodes=np.nonzero(detected)[1].astype(np.int32),
        danger=np.concatenate(danger),
        torque=np.concatenate(torque),
        peak=peak_field(starts, ends, capsules, RADII)[0],
        on_robot=int((robot & within).sum()),
        too_near=int((dummy & (distance < nodes.range_min)).sum()),
    )


def pieces(pairs: int) -> list[tuple[int, int]]:
    """First pair and number of pairs of each piece of a sample."""
    return [(first, min(CHUNK, pairs - first)) for first in range(0, pairs, CHUNK)]
