"""Floor, pedestal, light and camera: what a picture needs and physics does not."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

SCENERY = 0  # geometry group
CAMERA = "overview"


def add_surroundings(spec: Any, pedestal: float) -> None:
    """Floor, pedestal, light, camera and the looks of the picture."""
    view = spec.visual
    view.global_.offwidth, view.global_.offheight = 1920, 1080
    view.headlight.ambient, view.headlight.diffuse, view.headlight.specular = [0.34] * 3, [0.16] * 3, [0.0] * 3
    view.map.znear, view.map.zfar = 0.02, 40.0
    view.quality.offsamples = 0
    view.quality.shadowsize = 2048
    view.quality.numslices, view.quality.numstacks = 20, 10
    spec.stat.center, spec.stat.extent = [0.3, 0.0, 0.2], 3.0

    texture, kind, builtin = spec.add_texture, mujoco.mjtTexture, mujoco.mjtBuiltin
    texture(
        name="sky",
        type=kind.mjTEXTURE_SKYBOX,
        builtin=builtin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.94, 0.95],
        rgb2=[0.72, 0.76, 0.80],
        width=64,
        height=384,
    )
    texture(
        name="tiles",
        type=kind.mjTEXTURE_2D,
        builtin=builtin.mjBUILTIN_CHECKER,
        rgb1=[0.80, 0.81, 0.82],
        rgb2=[0.76, 0.77, 0.785],
        width=256,
        height=256,
    )
    floor = spec.add_material(name="floor", texrepeat=[1.0, 1.0], texuniform=True, specular=0.0, shininess=0.0)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"

    world = spec.worldbody
    box, plane, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_CYLINDER
    world.add_geom(name="floor", type=plane, size=[0, 0, 0.1], pos=[0, 0, -pedestal], material="floor", group=SCENERY)
    steel = {"rgba": [0.36, 0.38, 0.41, 1.0], "group": SCENERY, "contype": 0, "conaffinity": 0}
    plate = 0.02
    world.add_geom(
        name="pedestal",
        type=cylinder,
        size=[0.17, (pedestal - plate) / 2, 0],
        pos=[-0.06, 0, -(pedestal + plate) / 2],
        **steel,
    )
    world.add_geom(name="pedestal_top", type=box, size=[0.27, 0.23, plate / 2], pos=[-0.06, 0, -plate / 2], **steel)
    world.add_geom(
        name="pedestal_foot",
        type=box,
        size=[0.30, 0.30, plate / 2],
        pos=[-0.06, 0, -pedestal + plate / 2],
        **steel,
    )

    # An even light from nowhere in particular, and a lamp that models the shapes. Of the two only the lamp may cast
    # shadows: those of a spot light are clean where those of a directional one speckle.
    light = mujoco.mjtLightType
    world.add_light(
        name="daylight",
        type=light.mjLIGHT_DIRECTIONAL,
        dir=[0.35, 0.55, -1.0],
        diffuse=[0.42] * 3,
        specular=[0.0] * 3,
        castshadow=False,
    )
    world.add_light(
        name="lamp",
        type=light.mjLIGHT_SPOT,
        pos=[-1.9, -0.4, 3.8],
        dir=[2.4, 0.4, -3.8],
        cutoff=60.0,
        exponent=2.0,
        diffuse=[0.45] * 3,
        specular=[0.15] * 3,
        castshadow=True,
    )
    add_camera(world, CAMERA, [-3.95, -2.75, 2.25], [0.50, -0.10, 0.12], 28.0)


def add_camera(world: Any, name: str, position: list[float], target: list[float], fovy: float) -> None:
    """A camera that looks at a point with the horizon level.

    Args:
        world: MuJoCo's specification.
        name: Of the camera.
        position: (3,) [m].
        target: What it looks at (3,) [m].
        fovy: Vertical field of view [deg].
    """
    backward = np.subtract(position, target)
    backward /= np.linalg.norm(backward)
    right = np.cross([0.0, 0.0, 1.0], backward)
    right /= np.linalg.norm(right)
    up = np.cross(backward, right)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.stack([right, up, backward], axis=1).ravel())
    world.add_camera(name=name, pos=position, quat=quaternion, fovy=fovy)
