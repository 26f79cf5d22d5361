"""The robot, what it carries and the known obstacles around it as convex hulls in flat arrays, for compiled code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.geometry import layout
from qpsafe.geometry.hull import Hull
from qpsafe.geometry.layout import frozen
from qpsafe.geometry.measure import apart_at_home, own_pairs
from qpsafe.sensing.body import body_hulls, fixed_to
from qpsafe.sensing.hulls import Obstacle

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Solids:
    """Convex hulls on bodies: 0 is the world, i the body that joint i moves, see `RobotState.body_poses`.

    Its arrays are read-only; their columns stand in `qpsafe.geometry.layout`. Shapes are in the order: the robot's,
    things carried, known obstacles.

    Attributes:
        names: Of the shapes, (g,).
        index: What they are, and where they have their vertices and planes, (g, 10).
        shapes: Their poses, sizes and bounds, (g, 26).
        vertices: Of all hulls, (v, 3) [m].
        starts: First neighbour of each vertex, (v + 1,).
        neighbours: Vertices at the other ends of a vertex's edges.
        planes: Of the hulls' faces, (p, 4).
        robot: Which shapes move: the robot's but for its base, and what it carries, (r,).
        furniture: Pairs of a moving shape of the robot's own and a known obstacle, apart at the robot's home, (m, 2).
            Things carried are in none: they touch furniture where they are picked up and put down.
        own: Pairs of the robot's shapes, its base and what it carries included, on bodies that are neither the same nor
            joined, apart at home, (m, 2).
        known: How many known obstacles there are: the last shapes.
    """

    names: tuple[str, ...]
    index: Index
    shapes: Array
    vertices: Array
    starts: Index
    neighbours: Index
    planes: Array
    robot: Index
    furniture: Index
    own: Index
    known: int

    @property
    def solid(self) -> tuple[Index, Array, Array, Index, Index, Array]:
        """What distances are measured to: index, shapes, vertices, starts, neighbours, planes."""
        return self.index, self.shapes, self.vertices, self.starts, self.neighbours, self.planes

    @classmethod
    def of(
        cls,
        robot: Robot,
        known: Sequence[Obstacle] = (),
        carried: Mapping[str, Sequence[Obstacle]] | None = None,
    ) -> Solids:
        """The solids around a robot, it among them.

        Args:
            robot: The robot; one whose model has no collision geometry has no shapes.
            known: Obstacles that stand still in the world.
            carried: What the tool carries, by the frame it is fixed to and in its axes.

        Raises:
            ConfigurationError: The robot has no such frame, or a hull no volume.
            RobotFileError: The robot's collision geometry cannot be read.
        """
        own = list(body_hulls(robot))
        for frame, things in ({} if carried is None else carried).items():
            own += [fixed_to(robot, frame, thing) for thing in things]
        placed = [*own, *((0, thing.name, thing.vertices) for thing in known)]
        hulls = [_hull(name, np.ascontiguousarray(vertices, dtype=float)) for _, name, vertices in placed]
        index = np.zeros((len(placed), layout.INTEGERS), dtype=np.int64)
        shapes = np.zeros((len(placed), layout.FLOATS))
        first = np.zeros(2, dtype=np.int64)
        for row, numbers, (body, _, _), hull in zip(index, shapes, placed, hulls, strict=True):
            counts = np.array((len(hull.vertices), len(hull.planes)))
            row[[layout.KIND, layout.BODY]] = layout.MESH, body
            row[[layout.VERTEX, layout.PLANES_FROM]] = first
            row[[layout.VERTICES, layout.PLANES]] = counts
            first += counts
            layout.describe(numbers, layout.MESH, np.eye(4), np.zeros(3), hull.vertices)
        tables = Hull.joined(hulls)._asdict()
        solid = index, shapes, *tables.values()
        of_robot = np.arange(len(own))
        moving = of_robot[index[: len(own), layout.BODY] > 0]
        count = len(body_hulls(robot))  # what is carried touches furniture where it is picked up and put down
        pairs = ((i, j) for i in moving.tolist() if i < count for j in range(len(own), len(placed)))
        return cls(
            names=tuple(name for _, name, _ in placed),
            index=frozen(index, np.int64),
            shapes=frozen(shapes),
            **{name: frozen(table, table.dtype) for name, table in tables.items()},
            robot=frozen(moving, np.int64),
            furniture=apart_at_home(solid, robot, pairs),
            own=own_pairs(solid, robot, of_robot),
            known=len(known),
        )


def _hull(name: str, vertices: Array) -> Hull:
    from scipy.spatial import QhullError

    try:
        return _made(vertices.tobytes())
    except QhullError:
        expected = "vertices that span a volume [m]"
        raise ConfigurationError("Solids", name, f"{len(vertices)} flat vertices", expected) from None


@lru_cache(maxsize=512)
def _made(vertices: bytes) -> Hull:
    """Made once: many controllers have the same robot."""
    return Hull.of(np.frombuffer(vertices).reshape(-1, 3))
