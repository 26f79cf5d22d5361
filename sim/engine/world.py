"""All shapes of a scene but people and boards, in flat arrays for compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.geometry import layout
from qpsafe.geometry.layout import frozen
from qpsafe.sim.engine.hull_mesh import HullMesh, hull_mesh, joined
from qpsafe.sim.world.robot_spec import ROBOT_COLLISION
from qpsafe.sim.world.surroundings import SCENERY

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState
    from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]
Index = NDArray[np.int64]

KINDS = {
    layout.PLANE: "plane",
    layout.SPHERE: "sphere",
    layout.CAPSULE: "capsule",
    layout.ELLIPSOID: "ellipsoid",
    layout.CYLINDER: "cylinder",
    layout.BOX: "box",
    layout.MESH: "mesh",
}


@dataclass(frozen=True, eq=False)
class World:
    """Floor, scenery and the robot's collision geoms. Its arrays are read-only; their columns stand in `layout`.

    Shapes are fixed in bodies: 0 is the world, i the body i of `robot.tree`, whose poses come first in
    `RobotState.memory`, and then the bodies of `movable`.

    Attributes:
        names: Of the shapes, as in the scene, (g,).
        geoms: Their numbers in the scene, (g,).
        index: What they are, and where they have their vertices, planes and boxes, (g, 10).
        shapes: Their poses, sizes and bounds, (g, 26).
        vertices: Of the hulls of all meshes, (v, 3) [m].
        starts: First neighbour of each vertex, (v + 1,).
        neighbours: Vertices at the other ends of a vertex's edges.
        planes: Of the hulls' faces, (p, 4).
        boxes: Trees of boxes around the triangles of all meshes, (m, 6) [m], see `HullMesh`.
        nodes: How the trees hang together, (m, 3).
        triangles: A corner and the two edges from it, (t, 9) [m].
        robot: Which shapes are the robot's, (r,).
        furniture: Which are tables, supports, boxes: all fixed boxes of the scenery but the pedestal's.
        floors: Which are planes.
        movable: The scene's bodies that carry scenery and are neither fixed nor the robot's.
        bodies: How many bodies there are, the world among them.
    """

    names: tuple[str, ...]
    geoms: Index
    index: Index
    shapes: Array
    vertices: Array
    starts: Index
    neighbours: Index
    planes: Array
    boxes: Array
    nodes: Index
    triangles: Array
    robot: Index
    furniture: Index
    floors: Index
    movable: Index
    bodies: int

    @property
    def seen(self) -> tuple[Index, Array, Array, Index, Array]:
        """What rays are cast against: index, shapes, boxes, nodes, triangles."""
        return self.index, self.shapes, self.boxes, self.nodes, self.triangles

    @property
    def solid(self) -> tuple[Index, Array, Array, Index, Index, Array]:
        """What distances are measured to: index, shapes, vertices, starts, neighbours, planes."""
        return self.index, self.shapes, self.vertices, self.starts, self.neighbours, self.planes

    def poses(self, state: RobotState, data: Any = None) -> Array:
        """Poses of the bodies, (b, 4, 4) [m].

        Args:
            state: The robot.
            data: State of the scene, of which the poses of `movable` are; not needed if there is none.
        """
        poses, n = np.zeros((self.bodies, 4, 4)), self.bodies - len(self.movable)
        poses[:n] = state.body_poses()
        if len(self.movable):
            poses[n:, :3, :3] = data.xmat[self.movable].reshape(-1, 3, 3)
            poses[n:, :3, 3], poses[n:, 3, 3] = data.xpos[self.movable], 1.0
        return poses

    @classmethod
    def of(cls, scene: Scene, *, movable: bool = False) -> World:
        """The world of a scene.

        Args:
            scene: From `build_scene`.
            movable: Whether scenery that can move, like the screws of the pick-and-place cell, is part of it. Then
                poses of the bodies `movable` must follow those of the robot's; by default it is left out.

        Raises:
            ConfigurationError: A geom is of a kind that has no place here (a height field, a signed distance field),
                or a mesh without volume.
        """
        model, data = scene.model, scene.make_data()
        owners, loose = owners_of(scene)
        poses = [*scene.robot.at(scene.robot.home).body_poses(), *(_pose(data.xpos[b], data.xmat[b]) for b in loose)]
        geoms = [
            g
            for g in np.flatnonzero((model.geom_group == SCENERY) | (model.geom_group == ROBOT_COLLISION)).tolist()
            if movable or owners[model.geom_bodyid[g]] <= scene.robot.nq
        ]
        meshes: list[HullMesh] = []
        index, shapes = np.zeros((len(geoms), layout.INTEGERS), dtype=np.int64), np.zeros((len(geoms), layout.FLOATS))
        counts = np.zeros(3, dtype=np.int64)
        for row, numbers, g in zip(index, shapes, geoms, strict=True):
            body, kind = model.geom_bodyid[g], int(model.geom_type[g])
            if kind not in KINDS:
                kinds = ", ".join(KINDS.values())
                raise ConfigurationError("World", f"geom {model.geom(g).name}", model.geom_type[g], f"one of {kinds}")
            row[: layout.VERTEX] = kind, owners[body], body, _is_seen(model, g)
            place = np.linalg.inv(poses[owners[body]]) @ _pose(data.geom_xpos[g], data.geom_xmat[g])
            points = None
            if kind == layout.MESH:
                meshes.append(_mesh(model, g))
                points = meshes[-1].hull.vertices
                sizes = [len(points), len(meshes[-1].hull.planes), len(meshes[-1].boxes)]
                row[layout.VERTEX :] = np.stack((counts, sizes), axis=1).ravel()
                counts += sizes
            layout.describe(numbers, kind, place, model.geom_size[g], points)
        hulls, *rays = joined(meshes)
        tables = hulls._asdict() | dict(zip(("boxes", "nodes", "triangles"), rays, strict=True))
        solid = (index[:, layout.KIND] == layout.BOX) | (index[:, layout.KIND] == layout.MESH)
        scenery = model.geom_group[geoms] == SCENERY
        pedestal = np.array([model.geom(g).name.startswith("pedestal") for g in geoms], dtype=bool)
        return cls(
            names=tuple(model.geom(g).name for g in geoms),
            geoms=frozen(geoms, np.int64),
            index=frozen(index, np.int64),
            shapes=frozen(shapes),
            **{name: frozen(table, table.dtype) for name, table in tables.items()},
            robot=frozen(np.flatnonzero(~scenery), np.int64),
            furniture=frozen(np.flatnonzero(scenery & (index[:, layout.BODY] == 0) & solid & ~pedestal), np.int64),
            floors=frozen(np.flatnonzero(index[:, layout.KIND] == layout.PLANE), np.int64),
            movable=frozen(loose if movable else [], np.int64),
            bodies=scene.robot.nq + 1 + (len(loose) if movable else 0),
        )

    def take(self, chosen: Sequence[int] | Index) -> World:
        """Some of the shapes, or all in another order; tables of meshes stay as they are."""
        rows = np.asarray(chosen, dtype=np.int64)
        kept: dict[str, Any] = {
            name: frozen(np.flatnonzero(np.isin(rows, getattr(self, name))), np.int64) for name in _CHOICES
        }
        tables: dict[str, Any] = {name: frozen(getattr(self, name)[rows], getattr(self, name).dtype) for name in _ROWS}
        return replace(self, names=tuple(self.names[i] for i in rows), **tables, **kept)


_CHOICES, _ROWS = ("robot", "furniture", "floors"), ("geoms", "index", "shapes")


def owners_of(scene: Scene) -> tuple[list[int], list[int]]:
    """Body of the world that each body of the scene belongs to, and the scene's bodies that are not the robot's.

    Joints that are held do not move their bodies.
    """
    model, robot = scene.model, scene.robot
    number = {f"robot/{name}": i + 1 for i, name in enumerate(robot.joint_names)}
    held = {f"robot/{name}" for name in robot.held}
    owners: list[int] = [0]
    loose: list[int] = []
    for body in range(1, model.nbody):
        first = model.body_jntadr[body]
        names = [model.joint(j).name for j in range(first, first + model.body_jntnum[body])]
        moving = [name for name in names if name not in held]
        if not moving:
            owners.append(owners[model.body_parentid[body]])
        elif moving[-1] in number:
            owners.append(number[moving[-1]])
        else:
            owners.append(robot.nq + 1 + len(loose))
            loose.append(body)
    return owners, loose


def _pose(position: Array, matrix: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix.reshape(3, 3), position
    return pose


def _is_seen(model: Any, geom: int) -> bool:
    """Whether MuJoCo's rays meet a geom: not what is fully transparent."""
    material = int(model.geom_matid[geom])
    alpha = model.geom_rgba[geom, 3] if material < 0 else model.mat_rgba[material, 3]
    return bool(alpha > 0.0)


def _mesh(model: Any, geom: int) -> HullMesh:
    from scipy.spatial import QhullError

    mesh = int(model.geom_dataid[geom])
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    begin, number = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    try:
        return _hull_mesh(
            model.mesh_vert[first : first + count].tobytes(), model.mesh_face[begin : begin + number].tobytes()
        )
    except QhullError:
        raise ConfigurationError("World", f"mesh {model.mesh(mesh).name}", f"{count} vertices", "a volume") from None


@lru_cache(maxsize=256)
def _hull_mesh(vertices: bytes, triangles: bytes) -> HullMesh:
    """Made once, since every experiment has the same robot; from MuJoCo's float32 and int32."""
    places = np.frombuffer(vertices, dtype=np.float32).reshape(-1, 3).astype(np.float64)
    return hull_mesh(places, np.frombuffer(triangles, dtype=np.int32).reshape(-1, 3).astype(np.int64))
