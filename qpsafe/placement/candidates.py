"""Candidate nodes of section III: where a sensor could sit on the robot's surface, with the matrices of eq. (7)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.placement.coverage import Caps
from qpsafe.placement.grid import NEAREST, lattice, looks_out, thin_out
from qpsafe.placement.sensors import Sensor
from qpsafe.placement.sight import SelfSight, zone_rays
from qpsafe.placement.surface import Surface, link_surface
from qpsafe.sensing.skin.spot import Spot, axes_along
from qpsafe.sensing.skin.spots import SpotArray

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.robot_file.spec import Region

Array = NDArray[np.float64]

#: How many candidates the paper has on its IRB 140.
SOURCE_NODES = 254
COARSE = 0.015  # lattice that measures a region [m]
BLIND = 0.25  # largest share of an array's zones that may see nothing but the link that carries it
FINE = 5.0  # the lattice that fills gaps is finer than the grid by this
_PASSES, _ROUNDS = 6, 8  # of the search for the spacing of a wanted number


@dataclass(frozen=True)
class Candidates:
    """Candidate nodes.

    Attributes:
        nodes: One possible sensor each, n_nodes of them.
        spacing: Of the grid [m].
        sensor: What is to be placed.
        region: Of each node, its place among the robot's regions, (n_nodes,).
        free: Which zones of a sensor there see more than the link that carries it, (n_nodes, z).
    """

    nodes: SpotArray
    spacing: float
    sensor: Sensor
    region: NDArray[np.int64]
    free: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def links(self) -> NDArray[np.int64]:
        """What the danger that each node sees is counted by, (n_nodes,): its link, or all as one for arrays."""
        return np.zeros_like(self.nodes.links) if self.sensor.is_array else self.nodes.links

    def caps(self, robot: Robot) -> Caps:
        """How many spots the robot's regions take; of arrays as many as one likes, but none where `at_most` is 0."""
        free = (None, *range(1, len(self) + 1)) if self.sensor.is_array else (None,)
        most = [len(self) if region.at_most in free else region.at_most for region in robot.regions]
        return Caps(self.region, np.array(most, dtype=np.int64))


def candidate_nodes(
    robot: Robot,
    wanted: int = SOURCE_NODES,
    *,
    spacing: float | None = None,
    sensor: Sensor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Candidates:
    """An equally spaced grid of nodes on the regions of the robot's surface, see `qpsafe.placement.grid`.

    Args:
        robot: With `[[regions]]` in its robot.toml.
        wanted: Number of nodes; the spacing is searched that gives it, or the number nearest to it.
        spacing: Use this one instead [m].
        sensor: What is to be placed; by default the Sharp sensor from 20 to 80 cm.
        progress: Called with the number of grids tried while the spacing is searched, and the last one's nodes.

    Raises:
        RobotFileError: The robot has no region, or nothing of the surface looks out freely in one.
        ConfigurationError: `wanted` is below 1, or the spacing or the sensor's range make no sense.
    """
    sensor = Sensor() if sensor is None else sensor
    sensor.check()
    if not robot.regions:
        raise RobotFileError(robot.folder / "robot.toml", "regions", None, "at least one [[regions]] to put sensors on")
    if not (isinstance(wanted, int) and wanted >= 1):
        raise ConfigurationError("candidate_nodes", "wanted", wanted, "a number of nodes >= 1")
    # an array has other zones for what the robot hides: only what counts whatever it is matters
    reach = sensor.always if sensor.is_array else sensor.range_max
    sight = SelfSight(robot, sensor.always, reach, sensor.opening, sensor.directions if sensor.is_array else None)
    patches = [_Patch(robot, region, sensor, sight) for region in robot.regions]
    if spacing is None:
        # the area that looks out, by a coarse lattice, says what to expect
        area = sum(patch.coarse for patch in patches) * COARSE**2
        spacing = _spacing_for(patches, wanted, float(np.sqrt(area / wanted)), progress)
    elif np.isfinite(spacing) and 1e-3 <= spacing <= 1.0:
        for patch in patches:
            patch.refine(spacing / FINE)
    else:
        raise ConfigurationError("candidate_nodes", "spacing", spacing, "0.001 to 1 m")
    spots: list[Spot] = []
    region: list[int] = []
    free = []
    for i, patch in enumerate(patches):
        points, normals = patch.grid(spacing)
        if not len(points) and not patch.coarse:
            continue
        spots += patch.spots(robot, points, normals)
        free.append(patch.free(points, normals))
        region += [i] * len(points)
    return Candidates(SpotArray.of(spots), spacing, sensor, np.array(region, dtype=np.int64), np.concatenate(free))


class _Patch:
    """One region: its part of the surface, and a fine lattice on it."""

    def __init__(self, robot: Robot, region: Region, sensor: Sensor, sight: SelfSight) -> None:
        self.region, self.sensor, self.sight, self.file = region, sensor, sight, robot.folder / "robot.toml"
        surface = link_surface(robot, region)
        self.box = np.stack((region.lower, region.upper))
        near = (surface.skin.max(axis=1) >= region.lower) & (surface.skin.min(axis=1) <= region.upper)
        self.surface = Surface(surface.skin[near.all(axis=1)], surface.body)
        self.normals = self.surface.normals()

    @cached_property
    def coarse(self) -> int:
        """How many points of a coarse lattice can be used.

        Raises:
            RobotFileError: None, though some are wanted.
        """
        count = len(self.usable_lattice(COARSE)[0])
        if count == 0 and self.region.at_most != 0:
            expected = "a box with some surface of the link in it that does not look at the link itself"
            where = f"regions ({self.region.name}).lower"
            raise RobotFileError(self.file, where, self.region.lower.tolist(), expected)
        return count

    def lattice(self, spacing: float) -> tuple[Array, Array]:
        """Lattice points in the box, and their normals, (k, 3) each."""
        points, normals = lattice(self.surface.skin, self.normals, self.box, spacing)
        inside = ((points >= self.box[0] - 1e-9) & (points <= self.box[1] + 1e-9)).all(axis=1)
        return points[inside], normals[inside]

    def usable(self, points: Array, normals: Array) -> NDArray[np.bool_]:
        """Which points look out and see no other part of the robot, (k,)."""
        usable = looks_out(points, normals, self.surface.body, self.sensor.range_max)
        at = self.region
        usable[usable] = self.sight.clear(at.frame, points[usable], normals[usable], at.self_sight)
        usable[usable] = (~self.free(points[usable], normals[usable])).mean(axis=1) <= BLIND
        return usable

    def free(self, points: Array, normals: Array) -> NDArray[np.bool_]:
        """Which zones of sensors at points do not look at the body that carries them, (k, z)."""
        if not self.sensor.is_array:
            return np.ones((len(points), 1), dtype=np.bool_)  # along the normal, see `usable`
        rays = zone_rays(normals, self.sensor.directions)
        starts = np.repeat(points, rays.shape[1], axis=0)
        out = looks_out(starts, rays.reshape(-1, 3), self.surface.body, self.sensor.range_max)
        return out.reshape(rays.shape[:2])

    def usable_lattice(self, spacing: float) -> tuple[Array, Array]:
        """Lattice points that can be used, and their normals, (k, 3) each."""
        points, normals = self.lattice(spacing)
        usable = self.usable(points, normals)
        return points[usable], normals[usable]

    def refine(self, pitch: float) -> None:
        """Lay the fine lattice. Which of its points can be used is found when a grid has a gap there."""
        self.fine = self.lattice(max(pitch, 0.001))
        self.known, self.use = np.zeros((2, len(self.fine[0])), dtype=np.bool_)

    def grid(self, spacing: float) -> tuple[Array, Array]:
        """Nodes and normals at a spacing, (k, 3) each."""
        points, normals = self.usable_lattice(spacing)
        kept = thin_out(points, normals, NEAREST * spacing)
        points, normals = points[kept], normals[kept]
        # what is near a node that is kept anyhow is thinned out, usable or not; `thin_out` decides what is on the edge
        gaps, ways = self.fine[0][:, None] - points, self.fine[1] @ normals.T
        near = ((gaps**2).sum(axis=-1) < (1.0 - 1e-9) * (NEAREST * spacing) ** 2) & (ways > 1e-8)
        news = np.flatnonzero(~near.any(axis=1) & ~self.known)
        self.known[news], self.use[news] = True, self.usable(self.fine[0][news], self.fine[1][news])
        points, normals = (np.concatenate((a, b[self.use])) for a, b in zip((points, normals), self.fine, strict=True))
        kept = thin_out(points, normals, NEAREST * spacing)
        return points[kept], normals[kept]

    def spots(self, robot: Robot, points: Array, normals: Array) -> list[Spot]:
        poses = np.array([node_pose(p, n) for p, n in zip(points, normals, strict=True)])
        region, sensor = self.region, self.sensor
        sides = _sides(robot.pose(region.frame, robot.home)[:3, :3] @ normals.T)
        count: Counter[str] = Counter()
        spots = []
        for pose, side in zip(poses, sides, strict=True):
            count[side] += 1
            name = f"{region.name} {side} {count[side]}"
            spots.append(Spot(name, region.link, region.frame, pose, *sensor[1:4]))
        return spots


def node_pose(point: Array, normal: Array) -> Array:
    """The constant matrix of eq. (7), (4, 4): origin in the node, z axis along the outward normal."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes_along(normal), point
    return pose


def _sides(directions: Array) -> list[str]:
    """What a person calls the sides that directions (3, k) look to while the robot is at home; x is ahead."""
    names = np.array([["rear", "front"], ["right", "left"], ["under", "top"]])
    axis = np.abs(directions).argmax(axis=0)
    return [str(names[a, int(directions[a, i] > 0.0)]) for i, a in enumerate(axis)]


def _spacing_for(
    patches: Sequence[_Patch], wanted: int, guess: float, progress: Callable[[int, int], None] | None
) -> float:
    """The spacing whose grid has the wanted number of nodes, or the number nearest to it.

    The number jumps: some are skipped. Then the search starts anew with gaps filled by another lattice, as fine as the
    last spacing suggests.
    """
    tried = 0

    def told(nodes: int) -> None:
        nonlocal tried
        tried += 1
        if progress is not None:
            progress(tried, nodes)

    best = (wanted + 1, guess, guess)  # how far off, spacing, and the guess that the fine lattice was laid with
    for _ in range(_PASSES):
        for patch in patches:
            patch.refine(guess / FINE)
        counts = _search(patches, wanted, guess, told)
        spacing = min(counts, key=lambda spacing: (abs(counts[spacing] - wanted), spacing))
        best = min(best, (abs(counts[spacing] - wanted), spacing, guess))
        if best[0] == 0 or spacing == guess:
            break
        guess = spacing
    _, spacing, pitch = best
    if pitch != guess:
        for patch in patches:
            patch.refine(pitch / FINE)
    return spacing


def _search(patches: Sequence[_Patch], wanted: int, guess: float, told: Callable[[int], None]) -> dict[float, int]:
    """Numbers of nodes by spacing, around the wanted one if it can be had."""
    counts: dict[float, int] = {}

    def count(spacing: float) -> int:
        if spacing not in counts:
            counts[spacing] = sum(len(patch.grid(spacing)[0]) for patch in patches)
            told(counts[spacing])
        return counts[spacing]

    spacing = guess
    for _ in range(4):  # the number falls with the square of the spacing, on the whole
        spacing *= float(np.clip(np.sqrt(count(spacing) / wanted), 0.5, 2.0))
    for step in range(1, 21):  # around there, on both sides in turn
        if wanted in counts.values():
            return counts
        count(spacing * (1.0 + (1 if step % 2 else -1) * 2e-3 * (step // 2)))
    for _ in range(_ROUNDS):  # then between any two neighbours on different sides of the wanted number
        for a, b in pairwise(sorted(counts)):
            if wanted in counts.values():
                return counts
            if b - a > 1e-5 * spacing and (counts[a] < wanted) != (counts[b] < wanted):
                count(0.5 * (a + b))
    return counts
