"""The bodies of a MuJoCo scene as meshes of a page: made once, then only moved and coloured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.world.robot_spec import shown_groups

if TYPE_CHECKING:
    from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

FLOOR = 12.0  # how far the floor is drawn [m]
STILL = 1e-6  # what moves less is not sent again
TURN = np.array([1.0, 0.0, 0.0, 0.0])


class Bodies:
    """What stands and moves in a scene.

    Args:
        server: Viser's.
        scene: The scene.
        dark: Whether the page is.

    Attributes:
        coloured: Meshes of each body of the robot, and their own colours.
    """

    def __init__(self, server: Any, scene: Scene, dark: bool = False) -> None:
        self._server, self._model = server, scene.model
        self._frames: dict[int, Any] = {}
        self._placed: dict[int, Array] = {}
        self.coloured: dict[int, list[tuple[Any, Colour]]] = {}
        data, model = scene.make_data(), scene.model
        shown = shown_groups(model)
        for body in range(model.nbody):
            parts = _parts(model, body, shown)
            if not parts:
                continue
            name = f"/cell/{model.body(body).name or body}"
            self._frames[body] = server.scene.add_frame(name, show_axes=False)
            for k, (colour, (vertices, faces)) in enumerate(parts.items()):
                mesh = server.scene.add_mesh_simple(
                    f"{name}/{k}",
                    vertices,
                    faces,
                    color=colour[:3],
                    opacity=colour[3] / 255.0 if colour[3] < 255 else None,
                )
                if model.body(body).name.startswith("robot/"):
                    self.coloured.setdefault(body, []).append((mesh, colour[:3]))
        planes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
        self._height = float(data.geom_xpos[planes[0], 2]) if len(planes) else 0.0
        self.darken(dark)
        self.show(data)

    def darken(self, dark: bool) -> None:
        """Draw the floor for a dark page, or a light one."""
        plane, cells, sections = ((44, 47, 51), (62, 66, 71), (84, 89, 95)) if dark else (
            (238, 240, 242), (214, 218, 222), (188, 193, 199))  # fmt: skip
        self._server.scene.add_grid(
            "/floor", FLOOR, FLOOR, position=(0.0, 0.0, self._height), plane_color=plane, plane_opacity=1.0,
            cell_color=cells, section_color=sections, cell_size=0.5, section_size=1.0, shadow_opacity=0.2,
        )  # fmt: skip

    def show(self, data: Any) -> None:
        """Put all bodies where a state has them, body poses up to date."""
        for body, frame in self._frames.items():
            pose = np.concatenate((data.xpos[body], data.xquat[body]))
            placed = self._placed.get(body)
            if placed is not None and np.abs(pose - placed).max() < STILL:
                continue
            self._placed[body] = pose
            frame.position, frame.wxyz = pose[:3], pose[3:]


def _parts(model: Any, body: int, shown: NDArray[np.uint8]) -> dict[tuple[int, int, int, int], tuple[Array, Any]]:
    """Meshes of a body by their colour: vertices (v, 3) in the body's frame and triangles (t, 3)."""
    found: dict[tuple[int, int, int, int], list[tuple[Array, Any]]] = {}
    first = model.body_geomadr[body]
    for geom in range(first, first + model.body_geomnum[body]):
        group, kind = int(model.geom_group[geom]), int(model.geom_type[geom])
        material = int(model.geom_matid[geom])
        rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
        if not (0 <= group < len(shown) and shown[group]) or rgba[3] <= 0.0 or kind == mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        made = _shape(model, geom, kind)
        if made is None:
            continue
        vertices, faces = made
        turned = np.empty(9)
        mujoco.mju_quat2Mat(turned, model.geom_quat[geom])
        placed = vertices @ turned.reshape(3, 3).T + model.geom_pos[geom]
        red, green, blue, alpha = np.round(255.0 * rgba).astype(int).tolist()
        found.setdefault((red, green, blue, alpha), []).append((placed, faces))
    return {colour: _joined(parts) for colour, parts in found.items()}


def _joined(parts: list[tuple[Array, Any]]) -> tuple[Array, Any]:
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    return (
        np.vstack([vertices for vertices, _ in parts]),
        np.vstack([faces + offset for (_, faces), offset in zip(parts, offsets, strict=False)]),
    )


def _shape(model: Any, geom: int, kind: int) -> tuple[Array, Any] | None:
    """Vertices and triangles of a geom in its own frame; None for kinds that are not drawn."""
    import trimesh.creation as create

    size, geoms = model.geom_size[geom], mujoco.mjtGeom
    if kind == geoms.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]))
    if kind == geoms.mjGEOM_BOX:
        made = create.box(extents=2.0 * size)
    elif kind == geoms.mjGEOM_SPHERE:
        made = create.icosphere(subdivisions=3, radius=size[0])
    elif kind == geoms.mjGEOM_ELLIPSOID:
        made = create.icosphere(subdivisions=3)
        made.apply_scale(size)
    elif kind == geoms.mjGEOM_CAPSULE:
        made = create.capsule(height=2.0 * size[1], radius=size[0], count=[20, 20])
        made.apply_translation((0.0, 0.0, -made.bounds.mean(axis=0)[2]))
    elif kind == geoms.mjGEOM_CYLINDER:
        made = create.cylinder(radius=size[0], height=2.0 * size[1], sections=40)
    else:
        return None
    if kind in (geoms.mjGEOM_BOX, geoms.mjGEOM_CYLINDER):  # of a cylinder only the rims are edges
        across = 1.0 if kind == geoms.mjGEOM_BOX else 0.0
        normals = np.asarray(made.face_normals) * (across, across, 1.0)
        return _creased(np.asarray(made.vertices), np.asarray(made.faces), normals)
    return np.asarray(made.vertices), np.asarray(made.faces)


def _creased(vertices: Array, faces: Any, normals: Array) -> tuple[Array, Any]:
    """Corners of their own for faces that look elsewhere, so that edges are drawn as edges: normals (t, 3)."""
    _, order = np.unique(np.round(normals, 1), axis=0, return_inverse=True)
    corners = np.stack((faces.ravel(), np.repeat(order.ravel(), 3)), axis=1)
    kept, new = np.unique(corners, axis=0, return_inverse=True)
    return vertices[kept[:, 0]], new.reshape(-1, 3)


def _mesh(model: Any, mesh: int) -> tuple[Array, Any]:
    """A mesh with one vertex for every pair of place and normal, so that edges stay sharp where its normals say so."""
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    begin, number = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    vertices = np.asarray(model.mesh_vert[first : first + count], dtype=np.float64)
    corners = model.mesh_face[begin : begin + number].ravel()
    normals = model.mesh_facenormal[begin : begin + number].ravel()
    pairs, new = np.unique(np.stack((corners, normals), axis=1), axis=0, return_inverse=True)
    return vertices[pairs[:, 0]], new.reshape(-1, 3)
