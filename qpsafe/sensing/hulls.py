"""Convex hulls of what is known to be there, and the test whether a point lies in one of them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled.compiled import Array, Vector, entry, inline, readable, row
from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.robot.models.collada import head_of
from qpsafe.text.given import number, numbers
from qpsafe.text.words import call


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A known obstacle that stands still: the convex hull of its vertices.

    Attributes:
        name: Shown in errors.
        vertices: In the world frame, (v, 3) [m]; its own, and read-only.

    Raises:
        ConfigurationError: Not (v, 3), not finite, or no volume.
    """

    name: str
    vertices: NDArray[np.float64]

    def __post_init__(self) -> None:
        own = _corners(self.name, self.vertices)
        own.flags.writeable = False
        object.__setattr__(self, "vertices", own)
        half_spaces(self.name, own)

    def __setstate__(self, state: dict[str, object]) -> None:
        """Unpickled and copied arrays can be written to again."""
        self.__dict__.update(state)
        self.vertices.flags.writeable = False

    def __repr__(self) -> str:
        return call(self, self.name, lowest=self.vertices.min(axis=0), highest=self.vertices.max(axis=0))

    @classmethod
    def box(cls, name: str, size: ArrayLike, centre: ArrayLike = (0.0, 0.0, 0.0), pose: ArrayLike = ()) -> Obstacle:
        """A box.

        Args:
            name: Shown in errors.
            size: Full edge lengths (3,) [m].
            centre: Its centre, world frame (3,) [m].
            pose: Instead of the centre, its pose (4, 4).

        Raises:
            ConfigurationError: Sizes, a centre or a pose that are none.
        """
        edges = _vector(name, "size", size, "three finite lengths > 0 [m]", 0.0)
        corners = np.array(list(product((-0.5, 0.5), repeat=3))) * edges
        place = _vector(name, "centre", centre, "three finite coordinates [m]")
        return cls(name, _placed(name, corners, pose, place))

    @classmethod
    def mesh(cls, name: str, path: str | Path, pose: ArrayLike = (), scale: float = 1.0) -> Obstacle:
        """The convex hull of a mesh file (STL, OBJ, DAE ...), read by coal.

        A DAE file is in the unit that it states; it is not turned to the upward axis that it states, as in robots.

        Args:
            name: Shown in errors.
            path: The file.
            pose: Of the mesh in the world, (4, 4); the identity by default.
            scale: Metres in one unit of the file; of a DAE file, by how much it is larger than it states.

        Raises:
            ConfigurationError: No such file, no mesh, a unit, a pose or a scale that are none.
        """
        import coal  # type: ignore[import-untyped]

        where = f"obstacle {name}"
        if not (isinstance(path, str | os.PathLike) and os.path.isfile(path)):
            raise ConfigurationError(where, "path", path, "a mesh file")
        metres = number(where, "scale", scale, "metres in one unit of the file, > 0", above=0.0)
        try:
            metres *= head_of(Path(path), "path", Path(path)).metres
            vertices = np.array(coal.MeshLoader().load(str(path), np.ones(3)).vertices(), dtype=float)
        except RobotFileError as error:  # it is no robot's
            raise ConfigurationError(where, error.key, error.value, error.expected) from None
        except (ValueError, RuntimeError) as error:
            raise ConfigurationError(where, "path", str(path), f"a mesh ({error})") from None
        return cls(name, _placed(name, vertices.reshape(-1, 3) * metres, pose, np.zeros(3)))


def _vector(name: str, key: str, value: ArrayLike, expected: str, above: float = -np.inf) -> Array:
    found = numbers(f"obstacle {name}", key, value, expected)
    if found.shape != (3,) or not (np.isfinite(found) & (found > above)).all():
        raise ConfigurationError(f"obstacle {name}", key, value, expected)
    return found


def _placed(name: str, points: Array, pose: ArrayLike, centre: Array) -> Array:
    """Points as a pose moves them, or to a centre (3,) where no pose is given: ()."""
    T = numbers(f"obstacle {name}", "pose", pose, expected := "a finite (4, 4) pose")
    if not T.size:
        return points + centre
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise ConfigurationError(f"obstacle {name}", "pose", pose, expected)
    return points @ T[:3, :3].T + T[:3, 3]


def _corners(name: str, vertices: ArrayLike) -> Array:
    """Vertices (v, 3) as an array of its own."""
    expected = "finite vertices (v, 3) that span a volume [m]"
    points = numbers(f"obstacle {name}", "vertices", vertices, expected)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4 or not np.isfinite(points).all():
        raise ConfigurationError(f"obstacle {name}", "vertices", f"an array of shape {points.shape}", expected)
    return points


def half_spaces(name: str, vertices: ArrayLike) -> Array:
    """Half-spaces n·x + b <= 0 of the convex hull of vertices (v, 3), rows (n, b) with unit normals n.

    The six sides of the bounding box are among them: they cut the spikes off that sharp edges grow when all faces are
    moved outwards by a tolerance.

    Raises:
        ConfigurationError: See `Obstacle`.
    """
    from scipy.spatial import QhullError

    points = _corners(name, vertices)
    try:
        return _planes(points.tobytes())
    except QhullError:
        flat = f"{len(points)} flat vertices"
        raise ConfigurationError(f"obstacle {name}", "vertices", flat, "vertices that span a volume [m]") from None


@lru_cache(maxsize=512)
def _planes(vertices: bytes) -> Array:
    """Made once, read-only: whoever loads a robot again has the same links."""
    from scipy.spatial import ConvexHull

    points = np.frombuffer(vertices).reshape(-1, 3)
    faces = ConvexHull(points).equations  # outward unit normals, offsets
    axes = np.vstack((np.eye(3), -np.eye(3)))
    sides = np.column_stack((axes, -np.concatenate((points.max(axis=0), -points.min(axis=0)))))
    planes = np.vstack((sides, faces))
    _, first = np.unique(planes.round(9), axis=0, return_index=True)  # triangles of one face have one plane
    found: Array = planes[np.sort(first)]
    found.flags.writeable = False
    return found


class HullSet:
    """Many hulls, each fixed in the frame of one of several bodies, as flat arrays for compiled code.

    Args:
        hulls: (body, name, vertices in the body's frame (v, 3) [m]) of each hull.
    """

    def __init__(self, hulls: Sequence[tuple[int, str, ArrayLike]]) -> None:
        points = [np.asarray(vertices, dtype=float) for _, _, vertices in hulls]
        centres = [0.5 * (p.min(axis=0) + p.max(axis=0)) for p in points]
        self._fill(
            [name for _, name, _ in hulls],
            [body for body, _, _ in hulls],
            [half_spaces(name, vertices) for _, name, vertices in hulls],
            centres,
            [float(np.linalg.norm(p - c, axis=1).max()) for p, c in zip(points, centres, strict=True)],
        )

    def _fill(
        self, names: list[str], bodies: list[int], planes: list[Array], centres: list[Array], radii: list[float]
    ) -> None:
        self.names = tuple(names)
        self.bodies = np.array(bodies, dtype=np.int64)
        self.planes = np.vstack([np.zeros((0, 4)), *planes])
        self.first = np.concatenate(([0], np.cumsum([len(p) for p in planes]))).astype(np.int64)
        self.centres = np.array(centres).reshape(-1, 3)
        self.radii = np.array(radii, dtype=float)
        #: For compiled code: bodies, first planes, planes, balls around the hulls (centre, radius) (h, 4).
        self.tables = (self.bodies, self.first, self.planes, np.column_stack((self.centres, self.radii)))

    def take(self, chosen: Sequence[int]) -> HullSet:
        """Some of the hulls."""
        return HullSet.joined([(self, i) for i in chosen])

    def __add__(self, other: HullSet) -> HullSet:
        """These hulls and the others."""
        return HullSet.joined([(hulls, i) for hulls in (self, other) for i in range(len(hulls))])

    @classmethod
    def joined(cls, chosen: Sequence[tuple[HullSet, int]]) -> HullSet:
        """Hulls of several sets; nothing is computed anew."""
        result = cls(())
        result._fill(
            [s.names[i] for s, i in chosen],
            [int(s.bodies[i]) for s, i in chosen],
            [s.planes[s.first[i] : s.first[i + 1]] for s, i in chosen],
            [s.centres[i] for s, i in chosen],
            [float(s.radii[i]) for s, i in chosen],
        )
        return result

    def __len__(self) -> int:
        return len(self.names)

    def find(self, points: Array, tolerance: Array, poses: Array) -> NDArray[np.int64]:
        """The first hull that each point lies in, (p,), -1 for none (and for a point that is not finite).

        Args:
            points: World frame, (p, 3) [m].
            tolerance: How far beyond the faces still counts as inside, (p,) [m]; negative: how deep it must be.
            poses: Of the bodies in the world, (b, 4, 4).
        """
        found = np.empty(len(points), dtype=np.int64)
        _find(points, tolerance, np.ascontiguousarray(poses), *self.tables, found)
        return found


@inline
def within(p: Vector, t: float, poses: Array, bodies: Array, first: Array, planes: Array, balls: Array) -> int:
    """The first hull that the point p lies in, or no farther than t from all of its faces; -1 for none."""
    for h in range(bodies.shape[0]):
        T, cx, cy, cz = poses[bodies[h]], balls[h, 0], balls[h, 1], balls[h, 2]
        dx = p[0] - (T[0, 0] * cx + T[0, 1] * cy + T[0, 2] * cz + T[0, 3])
        dy = p[1] - (T[1, 0] * cx + T[1, 1] * cy + T[1, 2] * cz + T[1, 3])
        dz = p[2] - (T[2, 0] * cx + T[2, 1] * cy + T[2, 2] * cz + T[2, 3])
        # a face moved out by t moves no point of the hull's box out by more than 2 t
        reach = balls[h, 3] + 2.0 * max(t, 0.0)
        if not dx * dx + dy * dy + dz * dz <= reach * reach:
            continue
        # the point in the body's frame
        x = T[0, 0] * dx + T[1, 0] * dy + T[2, 0] * dz + cx
        y = T[0, 1] * dx + T[1, 1] * dy + T[2, 1] * dz + cy
        z = T[0, 2] * dx + T[1, 2] * dy + T[2, 2] * dz + cz
        inside = True
        for k in range(first[h], first[h + 1]):
            if not planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] * z + planes[k, 3] <= t:
                inside = False
                break
        if inside:
            return h
    return -1


_ints = types.Array(types.int64, 1, "C", readonly=True)
_two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (2, 3))


@entry(types.void(readable(2), readable(1), _three, _ints, _ints, _two, _two, types.int64[::1]))
def _find(
    points: Array,
    tolerance: Array,
    poses: Array,
    bodies: Array,
    first: Array,
    planes: Array,
    balls: Array,
    found: Array,
) -> None:
    for i in range(points.shape[0]):
        found[i] = within(row(points, i), tolerance[i], poses, bodies, first, planes, balls)
