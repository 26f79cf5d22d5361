"""A robot's model for MuJoCo: its MJCF file, or, of a URDF, what qpsafe understood of it.

MuJoCo reads URDF too, but drops frames with the fixed joints that carry them, finds no package:// meshes and knows
nothing of joints that are held. So a body for each joint is made from the robot's own tree: the two agree by
construction.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.extras import require
from qpsafe.robot.models.model_file import is_urdf

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

ROD = 0.02  # radius of the wire's links where a model has no collision geometry [m]
LIGHT, SMALL = 1e-3, 1e-6  # the least mass [kg] and moment of inertia [kg m²] of what moves


def mujoco_model(robot: Robot) -> Any:
    """The robot alone, compiled.

    Raises:
        RobotFileError: MuJoCo cannot make a model of it.
    """
    try:
        return mujoco_spec(robot)[0].compile()
    except ValueError as error:
        expected = f"a model that MuJoCo can read ({' '.join(str(error).split())})"
        raise RobotFileError(robot.model_path, "model", robot.model_path.name, expected) from None


def mujoco_spec(robot: Robot) -> tuple[Any, list[str]]:
    """The robot alone as a `mujoco.MjSpec`, and what had to be made up for it, in words.

    Raises:
        ValueError: MuJoCo cannot read the file.
    """
    require("sim", "a simulation", "mujoco")
    import mujoco

    if not is_urdf(robot.model_path):
        return mujoco.MjSpec.from_file(str(robot.model_path)), []
    spec, said = mujoco.MjSpec(), []
    spec.modelname, spec.compiler.degree = robot.name, False
    bodies = [spec.worldbody.add_body(name=_free(robot, "base"))]
    heavy = list(robot.model.inertias)
    for i, name in enumerate(robot.joint_names, 1):
        body = bodies[robot.tree.parents[i - 1]].add_body(name=_free(robot, f"{name} link"))
        body.pos, body.quat = _place(robot.tree.placements[i - 1])
        linear, angular = robot.tree.axes[i - 1, :3], robot.tree.axes[i - 1, 3:]
        kind = mujoco.mjtJoint.mjJNT_HINGE if angular.any() else mujoco.mjtJoint.mjJNT_SLIDE
        joint = body.add_joint(name=name, type=kind, axis=angular if angular.any() else linear)
        joint.range, joint.limited = [robot.lower[i - 1], robot.upper[i - 1]], mujoco.mjtLimited.mjLIMITED_TRUE
        bodies.append(body)
    for frame in list(robot.model.frames)[1:]:
        site = bodies[frame.parentJoint].add_site(name=frame.name, group=5)
        site.pos, site.quat = _place(frame.placement.homogeneous)
    shaped = _add_hulls(spec, robot, bodies)
    if not shaped:
        said.append(f"no collision geometry: the links are rods of {2e3 * ROD:g} mm along the robot's wire")
        shaped = _add_rods(robot, bodies)
    said += _add_inertia(robot, bodies, heavy, shaped)
    return spec, said


@lru_cache(maxsize=8)
def weighed_model(robot: Robot) -> Any:
    """pinocchio's model with a mass and an inertia for all that moves: what the file leaves out is as simulated.

    Without them a mass matrix is singular. A robot whose file states all of them has its own model, the very same.
    """
    lacking = [i for i in range(1, robot.nq + 1) if not _stated(robot.model.inertias[i])]
    if not lacking:
        return robot.model
    import pinocchio as pin

    compiled, found = mujoco_model(robot), robot.model.copy()
    for i in lacking:
        body = compiled.joint(robot.joint_names[i - 1]).bodyid[0]
        turned = pin.Quaternion(*compiled.body_iquat[body].tolist()).matrix()
        inertia = turned @ np.diag(compiled.body_inertia[body]) @ turned.T
        found.inertias[i] = pin.Inertia(float(compiled.body_mass[body]), compiled.body_ipos[body].copy(), inertia)
    return found


def _stated(inertia: Any) -> bool:
    """Whether a file states a mass and an inertia that a body can have."""
    return bool(inertia.mass > LIGHT and np.linalg.eigvalsh(inertia.inertia)[-1] > 0.0)


def _add_hulls(spec: Any, robot: Robot, bodies: list[Any]) -> set[int]:
    import mujoco

    hulls = robot.hulls()
    for k, (body, name, vertices) in enumerate(hulls):
        mesh = f"hull {k}: {name}"
        spec.add_mesh(name=mesh, uservert=vertices.ravel())
        bodies[body].add_geom(name=mesh, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, rgba=_paint(body))
    return {body for body, _, _ in hulls}


def _add_rods(robot: Robot, bodies: list[Any]) -> set[int]:
    """Links of the wire as capsules on the body of their start, where they are at home."""
    import mujoco

    poses, wire = robot.at(robot.home).body_poses(), robot.wire(robot.home, np.zeros(robot.nq))
    shaped = set()
    for k, (start, _) in enumerate(robot.wire_frames):
        body = robot.mounting(start)[0]
        ends = np.stack((wire.starts[k], wire.ends[k])) - poses[body][:3, 3]
        if np.linalg.norm(ends[1] - ends[0]) > ROD:
            fromto = (ends @ poses[body][:3, :3]).ravel()
            looks = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "fromto": fromto, "size": [ROD, 0.0, 0.0]}
            bodies[body].add_geom(name=f"rod {k}", rgba=[0.0, 0.0, 0.0, 0.0], **looks)  # spots see through them
            bodies[body].add_geom(name=f"rod {k} seen", contype=0, conaffinity=0, rgba=_paint(body), **looks)
            shaped.add(body)
    return shaped


def _add_inertia(robot: Robot, bodies: list[Any], inertias: list[Any], shaped: set[int]) -> list[str]:
    """Mass and inertia as stated; else those of water in its shape, or a hundred grams if it has none."""
    import mujoco

    made_up = []
    for i, name in enumerate(robot.joint_names, 1):
        body, found = bodies[i], inertias[i]
        if not _stated(found):
            made_up.append(name)
            if i not in shaped:
                body.add_geom(
                    name=f"weight {i}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[ROD, 0, 0], mass=0.1, contype=0,
                    conaffinity=0, rgba=[0.0, 0.0, 0.0, 0.0],
                )  # fmt: skip
            continue
        moments, axes = np.linalg.eigh(found.inertia)
        moments = np.maximum(moments, SMALL)
        lacking = max(moments[2] - moments[0] - moments[1], 0.0)  # no body's moment is larger than the others' sum
        moments[:2] += 0.5 * lacking * (1.0 + 1e-9)
        inertia = axes @ np.diag(moments) @ axes.T
        body.mass, body.ipos, body.explicitinertial = found.mass, found.lever, True
        body.fullinertia = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    return [f"no mass is stated for what {', '.join(made_up)} moves: that of its shape in water"] if made_up else []


def _place(T: Array) -> tuple[Array, Array]:
    """Position and quaternion (w, x, y, z) of a pose."""
    import mujoco

    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(T[:3, :3]).ravel())
    return T[:3, 3].copy(), quaternion


def _free(robot: Robot, name: str) -> str:
    """A name for a body that is none of the robot's frames: those are sites."""
    while robot.model.existFrame(name):
        name = f"{name}_"
    return name


def _paint(body: int) -> list[float]:
    return [0.90, 0.55, 0.20, 1.0] if body % 2 else [0.35, 0.37, 0.40, 1.0]
