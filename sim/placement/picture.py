"""Pictures of the robot with its candidate nodes, as Fig. 3, and with the chosen spots, as Fig. 7."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.robot.models.mjcf import held_positions
from qpsafe.sim.drawing.gl import make_context
from qpsafe.sim.world.robot_spec import robot_spec, shown_groups
from qpsafe.text.whole_file import whole_file

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.skin.spots import SpotArray

NODE, SPOT = (0.10, 0.35, 0.85, 1.0), (0.05, 0.55, 0.25, 1.0)
SIZE = (560, 640)  # of a view [px]
SCALE = 2  # rendered larger, then averaged: smooth edges from any back end
VIEWS = (140.0, -40.0)  # azimuths, from the robot's left front and right rear [deg]


def picture(
    robot: Robot, spots: SpotArray, chosen: NDArray[np.intp] | None = None, q: NDArray[np.float64] | None = None
) -> NDArray[np.uint8]:
    """The robot from two sides, nodes as blue dots or chosen spots as green ones with their directions.

    Args:
        robot: The robot.
        spots: The nodes.
        chosen: Those that carry a spot; None: draw all nodes.
        q: Configuration, by default home.

    Returns:
        (height, width, 3) RGB.

    Raises:
        RuntimeError: No OpenGL back end works; ask `qpsafe.sim.drawing.gl.gl_available` first.
    """
    q = robot.home if q is None else q
    shown = spots if chosen is None else spots.subset([int(i) for i in chosen])
    width, height = SCALE * SIZE[0], SCALE * SIZE[1]
    model = _model(robot, shown, q, chosen is not None, width, height)
    data = mujoco.MjData(model)
    addresses, values = held_positions(model, robot.held, "robot/")
    data.qpos[addresses] = values
    for name, value in zip(robot.joint_names, q, strict=True):
        data.qpos[model.joint(f"robot/{name}").qposadr] = value
    mujoco.mj_forward(model, data)
    robot_geoms = [i for i in range(model.ngeom) if model.body(model.geom_bodyid[i]).name.startswith("robot/")]
    extent = data.geom_xpos[robot_geoms]
    centre = 0.5 * (extent.min(axis=0) + extent.max(axis=0))
    distance = 2.1 * float(np.linalg.norm(extent.max(axis=0) - extent.min(axis=0))) + 0.3
    context: Any = make_context(width, height)
    try:
        render = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, render)
        views = [_view(model, data, render, azimuth, centre, distance, (width, height)) for azimuth in VIEWS]
        render.free()
    finally:
        context.free()
    return np.hstack(views)


def save_picture(path: Path, robot: Robot, spots: SpotArray, chosen: NDArray[np.intp] | None = None) -> None:
    """Write `picture` as a PNG, whole or not at all.

    Args:
        path: The file.
        robot: The robot.
        spots: All nodes.
        chosen: Those that carry a spot; None: draw all nodes.
    """
    import matplotlib.image

    with whole_file(path) as part:
        matplotlib.image.imsave(part, picture(robot, spots, chosen), format="png")


def _view(
    model: Any, data: Any, render: Any, azimuth: float, centre: NDArray, distance: float, size: tuple[int, int]
) -> NDArray[np.uint8]:
    width, height = size
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = azimuth, -16.0, distance
    camera.lookat[:] = centre
    options = mujoco.MjvOption()
    options.geomgroup[:] = shown_groups(model)
    options.sitegroup[:] = 0
    drawing = mujoco.MjvScene(model, maxgeom=3000)
    everything = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, options, None, camera, everything, drawing)
    drawing.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
    drawing.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
    rect, pixels = mujoco.MjrRect(0, 0, width, height), np.empty((height, width, 3), np.uint8)
    mujoco.mjr_render(rect, drawing, render)
    mujoco.mjr_readPixels(pixels, None, rect, render)
    coarse = pixels[::-1].reshape(height // SCALE, SCALE, width // SCALE, SCALE, 3).astype(float).mean(axis=(1, 3))
    return np.clip(np.round(coarse), 0, 255).astype(np.uint8)


def _model(robot: Robot, shown: SpotArray, q: NDArray, with_directions: bool, width: int, height: int) -> Any:
    """The robot on a light ground, with a ball for every spot and a rod along its direction."""
    spec = mujoco.MjSpec.from_string(f"""
    <mujoco>
      <visual>
        <headlight ambient="0.45 0.45 0.45" diffuse="0.30 0.30 0.30" specular="0.1 0.1 0.1"/>
        <global offwidth="{width}" offheight="{height}" fovy="24"/>
        <quality offsamples="4"/>
        <rgba haze="1 1 1 1"/>
        <map znear="0.02"/>
      </visual>
      <asset>
        <texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="32" height="32"/>
        <material name="floor" rgba="1 1 1 1" emission="0.38" specular="0" shininess="0"/>
      </asset>
      <worldbody>
        <light type="directional" dir="-0.4 0.5 -0.8" diffuse="0.35 0.35 0.35" castshadow="false"/>
        <geom type="plane" size="20 20 0.1" material="floor"/>
      </worldbody>
    </mujoco>""")
    spec.attach(robot_spec(robot)[0], frame=spec.worldbody.add_frame(), prefix="robot/")
    origins, directions = shown.rays(robot.at(q))
    looks: dict[str, Any] = {"contype": 0, "conaffinity": 0, "group": 1, "rgba": SPOT if with_directions else NODE}
    sphere, capsule = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE
    for origin, direction in zip(origins, directions, strict=True):
        radius = 0.013 if with_directions else 0.0075
        spec.worldbody.add_geom(type=sphere, size=[radius, 0, 0], pos=origin, **looks)
        if with_directions:
            ends = np.concatenate((origin, origin + 0.07 * direction))
            spec.worldbody.add_geom(type=capsule, size=[0.004, 0, 0], fromto=ends, **looks)
    return spec.compile()
