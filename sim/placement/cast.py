"""One piece of the Monte Carlo simulation: pairs drawn, rays cast, danger computed. What a worker does."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco.batch
import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.field import DangerField, danger_vectors
from qpsafe.placement.boxes import may_meet
from qpsafe.placement.peak import peak_field
from qpsafe.placement.sample import NEAR, Detections
from qpsafe.placement.sight import zone_rays
from qpsafe.robot.loader import load_quietly
from qpsafe.sensing.skin.spots import SpotArray, rays_in_world
from qpsafe.sim.placement.draw import draw_pairs
from qpsafe.sim.placement.dummy import RADII
from qpsafe.sim.placement.world import PlacementWorld

if TYPE_CHECKING:
    from qpsafe.robot.wire import Wire

Array = NDArray[np.float64]

CHUNK = 256  # pairs of a piece; a multiple of 8


@dataclass(frozen=True, eq=False)
class Setup:
    """What workers need to know; small, and can be pickled.

    Attributes:
        robot: What `load_robot` finds the robot by; on other machines there must be the same file.
        nodes: The candidate nodes.
        zones: Where a sensor's zones look, in its own frame, (z, 3).
        free: Which zones of each node do not look at the link that carries it, (n, z).
        seed: Of everything random.
        radius: Of the disc that dummies stand in [m].
        pedestal: Height of the robot's base above the floor [m].
    """

    robot: str | Path
    nodes: SpotArray
    zones: Array
    free: NDArray[np.bool_]
    seed: int
    radius: float
    pedestal: float

    @cached_property
    def key(self) -> tuple[Any, ...]:
        """Equal for equal set-ups."""
        nodes = self.nodes
        arrays = (nodes.positions, nodes.directions, nodes.links, nodes.range_min, nodes.range_max)
        own = (array.tobytes() for array in (*arrays, self.zones, self.free))
        return (str(self.robot), self.pedestal, nodes.frames, *own)

    @property
    def is_of_arrays(self) -> bool:
        """Whether sensors have many zones."""
        return len(self.zones) > 1


class _Caster:
    """The world and the rays of a set-up, for one thread: a ray for each free zone, node after node."""

    def __init__(self, setup: Setup) -> None:
        robot = load_quietly(setup.robot)
        self.world = PlacementWorld(robot, setup.pedestal)
        self.node, zone = np.nonzero(setup.free)
        spots = setup.nodes.subset(self.node.tolist())
        directions = setup.nodes.directions
        if setup.is_of_arrays:
            directions = zone_rays(directions, setup.zones)[self.node, zone]
            spots = replace(spots, directions=directions)
        self.spots = spots
        self.bodies, self.rays = spots.mounting(robot)
        self.own = self.world.bodies_of(spots)
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
    nearer than the sensor's range: the sensor reads it as farther away. A node detects what any of its zones does; of
    the points of its zones the most dangerous one counts.

    Args:
        setup: The study's.
        sample: Which one.
        first: Number of the first pair.
        count: How many.
    """
    caster = _caster(setup)
    world, spots = caster.world, caster.spots
    robot = world.robot
    q, capsules = draw_pairs(world, setup.seed, sample, range(first, first + count), setup.radius)
    world.put(caster.batch, q, capsules)
    starts, ends = np.empty((2, count, len(robot.wire_frames), 3))
    counts, nodes, danger, torque, near = np.zeros(count, dtype=np.int64), [], [], [], []
    rest, field, (first_end, second_end) = np.zeros(robot.nq), DangerField(static=1.0, kinetic=0.0), robot.wire_indices
    on_robot = too_near = 0
    for p in range(count):
        state = robot.at(q[p])
        wire = state.wire(rest)
        starts[p], ends[p] = wire.starts, wire.ends
        origins, directions = rays_in_world(state.body_poses(), caster.bodies, caster.rays)
        rays = np.arange(len(origins))
        if setup.is_of_arrays:  # most zones look past the person
            rays = np.flatnonzero(_towards(origins, directions, capsules[p], float(spots.range_max.max())))
        distance, dummy, blocked = world.cast(caster.batch, p, origins[rays], directions[rays], caster.own[rays])
        within = distance <= spots.range_max[rays]
        detected = dummy & within & (distance >= spots.range_min[rays])
        on_robot += 0 if setup.is_of_arrays else int((blocked & within).sum())
        too_near += int((dummy & (distance < spots.range_min[rays])).sum())
        hits = rays[detected]
        points = origins[hits] + distance[detected][:, None] * directions[hits]  # eq. (7)
        value, gradient = field.evaluate(points, wire)  # eq. (9)
        close = np.linalg.norm(points - world.nearest(q[p], capsules[p])[0], axis=1) <= NEAR
        by_node = np.lexsort((value, caster.node[hits]))
        last = np.flatnonzero(np.diff(caster.node[hits][by_node], append=-1))  # of each node the most dangerous point
        best, which = by_node[last], caster.node[hits][by_node[last]]
        counts[p] = len(best)
        nodes.append(which)
        danger.append(value[best])
        near.append(np.isin(which, caster.node[hits[close]]))
        link = _nearest_link(points[best], wire) if setup.is_of_arrays else spots.links[hits[best]]
        jacobians = state.wire_jacobians()
        arm = jacobians[first_end] + jacobians[second_end]  # (links, 3, n)
        sigma = np.einsum("dxj,dx->dj", arm[link], danger_vectors(value[best], gradient[best]))
        torque.append(np.linalg.norm(sigma, axis=1))  # eqs. (14), (15) of this detection alone
    return Detections(
        counts=counts,
        nodes=np.concatenate(nodes).astype(np.int32),
        danger=np.concatenate(danger),
        torque=np.concatenate(torque),
        peak=peak_field(starts, ends, capsules, RADII)[0],
        near=np.concatenate(near),
        on_robot=on_robot,
        too_near=too_near,
    )


def _towards(origins: Array, directions: Array, capsules: Array, reach: float) -> NDArray[np.bool_]:
    """Which rays (m,) come near the dummy's capsules (17, 2, 3) at all: the world asks the others nothing."""
    low, high = capsules.min(axis=1) - RADII[:, None], capsules.max(axis=1) + RADII[:, None]
    none, level = np.zeros((len(low), 3)), np.tile(np.eye(3), (len(low), 1, 1))
    whole = np.concatenate((low.min(axis=0) + high.max(axis=0), high.max(axis=0) - low.min(axis=0)))[None]
    near = may_meet(origins, directions, none[:1], level[:1], 0.5 * whole, reach, 0.0)
    each = 0.5 * np.concatenate((low + high, high - low), axis=1)
    near[near] = may_meet(origins[near], directions[near], none, level, each, reach, 0.0)
    return near


def _nearest_link(points: Array, wire: Wire) -> NDArray[np.intp]:
    """The link of the wire that is nearest to each point (k, 3), (k,)."""
    along = wire.ends - wire.starts
    offset = points[:, None] - wire.starts
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip((offset * along).sum(axis=2) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=2).argmin(axis=1))


def pieces(pairs: int) -> list[tuple[int, int]]:
    """First pair and number of pairs of each piece of a sample."""
    return [(first, min(CHUNK, pairs - first)) for first in range(0, pairs, CHUNK)]
