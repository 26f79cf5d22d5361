"""The surface of one link as triangles, from the robot's model or from a mesh file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.extras import require
from qpsafe.robot.models.mjcf import held_positions
from qpsafe.robot.models.mujoco_spec import mujoco_model

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.robot_file.spec import Region

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """Triangles of a link, in the frame of a region [m].

    Attributes:
        skin: Those that may carry sensors, counter-clockwise seen from outside, (s, 3, 3).
        body: All of the link, what only decorates included: they can stand in a sensor's way, (t, 3, 3).
    """

    skin: Array
    body: Array

    def normals(self) -> Array:
        """Outward unit normals of the skin, (s, 3)."""
        n = np.cross(self.skin[:, 1] - self.skin[:, 0], self.skin[:, 2] - self.skin[:, 0])
        return n / np.linalg.norm(n, axis=1, keepdims=True)


def link_surface(robot: Robot, region: Region) -> Surface:
    """The surface that a region is cut from.

    Of the model's geometry, the skin is what collides, or everything if nothing of the link does; a mesh file of the
    region's own is both skin and body.

    Raises:
        RobotFileError: The model or the mesh cannot be read, or there is nothing.
        MissingExtraError: trimesh is needed, for a mesh file or a primitive shape, and not installed.
    """
    if region.mesh is not None:
        triangles = _closed_outwards(_read_mesh(region))
        return Surface(triangles, triangles)
    model, data, body = _model_at_home(robot, region.frame)
    to_frame = np.linalg.inv(robot.pose(region.frame, robot.home))
    skin, everything = [], []
    for geom in np.flatnonzero(model.body_weldid[model.geom_bodyid] == model.body_weldid[body]):
        world = _geom_triangles(model, int(geom)) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        triangles = _closed_outwards(world @ to_frame[:3, :3].T + to_frame[:3, 3])
        everything.append(triangles)
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            skin.append(triangles)
    if not everything:
        raise RobotFileError(robot.model_path, region.frame, "no geoms", f"a surface for region {region.name!r}")
    return Surface(np.concatenate(skin or everything), np.concatenate(everything))


def model_body(model: Any, robot: Robot, frame: str) -> int:
    """MuJoCo's number of the body that a frame is fixed to: the body of the joint that moves it, else the base.

    Args:
        model: MuJoCo's.
        robot: Of that model.
        frame: One of the robot's.
    """
    joint = robot.model.frames[robot.frame_id(frame)].parentJoint
    if joint > 0:
        return int(model.jnt_bodyid[model.joint(robot.model.names[joint]).id])
    return int(model.body_rootid[model.jnt_bodyid[model.joint(robot.joint_names[0]).id]])


def _model_at_home(robot: Robot, frame: str) -> tuple[Any, Any, int]:
    import mujoco

    model = mujoco_model(robot)
    try:
        data = mujoco.MjData(model)
        addresses, values = held_positions(model, robot.held)
        data.qpos[addresses] = values
        for name, value in zip(robot.joint_names, robot.home, strict=True):
            data.qpos[model.joint(name).qposadr] = value
        body = model_body(model, robot, frame)
    except (ValueError, KeyError) as error:
        expected = f"a model that MuJoCo can read ({error})"
        raise RobotFileError(robot.model_path, "model", robot.model_path.name, expected) from None
    mujoco.mj_kinematics(model, data)
    return model, data, body


def _geom_triangles(model: Any, geom: int) -> Array:
    """Triangles of a geom in its own frame, (t, 3, 3)."""
    import mujoco

    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        vertices = model.mesh_vert[first : first + count].astype(float)
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        return vertices[model.mesh_face[first : first + count]]
    make = _trimesh("a region on a primitive shape").creation
    shapes = {
        int(mujoco.mjtGeom.mjGEOM_BOX): lambda: make.box(2.0 * size),
        int(mujoco.mjtGeom.mjGEOM_SPHERE): lambda: make.icosphere(3, size[0]),
        int(mujoco.mjtGeom.mjGEOM_CAPSULE): lambda: make.capsule(2.0 * size[1], size[0], count=(32, 32)),
        int(mujoco.mjtGeom.mjGEOM_CYLINDER): lambda: make.cylinder(size[0], 2.0 * size[1], sections=32),
        int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): lambda: make.icosphere(3, 1.0).apply_scale(size),
    }
    if int(kind) not in shapes:
        return np.zeros((0, 3, 3))  # a plane or a height field is no link's
    triangles = np.array(shapes[int(kind)]().triangles, dtype=float)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:  # about its middle, as MuJoCo's
        triangles[..., 2] -= 0.5 * (triangles[..., 2].min() + triangles[..., 2].max())
    return triangles


def _read_mesh(region: Region) -> Array:
    trimesh = _trimesh(f"the mesh of region {region.name!r}")
    try:
        mesh = trimesh.load_mesh(region.mesh)
        triangles = np.array(mesh.triangles, dtype=float) * region.scale
    except Exception as error:  # a dozen readers, each with errors of its own
        raise RobotFileError(region.mesh, "file", str(region.mesh), f"a mesh that trimesh can read ({error})") from None
    if not len(triangles) or not np.isfinite(triangles).all():
        raise RobotFileError(region.mesh, "triangles", len(triangles), "at least one, of finite corners")
    return triangles


def _trimesh(what: str) -> Any:
    require("place", what, "trimesh")
    import trimesh
    import trimesh.creation

    return trimesh


def _closed_outwards(triangles: Array) -> Array:
    """The triangles of positive area, turned so that the volume they enclose is positive; an open surface as it is."""
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    triangles = triangles[area > 1e-12]
    if not len(triangles):
        return triangles
    local = triangles - triangles.reshape(-1, 3).mean(axis=0)
    volume = np.einsum("ti,ti->", local[:, 0], np.cross(local[:, 1], local[:, 2])) / 6.0
    return triangles[:, ::-1] if volume < 0.0 else triangles
