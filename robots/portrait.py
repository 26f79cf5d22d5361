"""Pictures of a bundled robot for the documentation; each robot's `picture.py` says from where it is seen."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib.image
import mujoco
import numpy as np
from numpy.typing import NDArray

SCALE = 2  # rendered larger, then averaged: smooth edges from any back end
SIZE = (560, 640)  # of one view, width and height in pixels
PICTURES = Path(__file__).resolve().parents[1] / "docs" / "img"


class View(NamedTuple):
    """One view: the robot's configuration [deg] and the camera's angles [deg], distance and target [m]."""

    q: Sequence[float]
    azimuth: float
    elevation: float
    distance: float
    lookat: Sequence[float]


def scene(xml: Path, width: int, height: int) -> mujoco.MjModel:
    """The robot on a light floor before a light background, at most width x height pixels."""
    spec = mujoco.MjSpec.from_string(f"""
    <mujoco>
      <visual>
        <headlight ambient="0.42 0.42 0.42" diffuse="0.22 0.22 0.22" specular="0.1 0.1 0.1"/>
        <global offwidth="{width}" offheight="{height}" fovy="24"/>
        <quality shadowsize="8192" offsamples="8"/>
        <rgba haze="1 1 1 1"/>
        <map znear="0.02" shadowscale="0.5"/>
      </visual>
      <asset>
        <texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="32" height="32"/>
        <material name="floor" rgba="1 1 1 1" emission="0.38" specular="0" shininess="0"/>
      </asset>
      <worldbody>
        <light type="spot" cutoff="89" exponent="0" pos="0.9 -1.7 3.0" dir="-0.28 0.55 -0.85" diffuse="0.7 0.7 0.7"/>
        <light type="spot" cutoff="89" exponent="0" pos="-1.2 1.8 2.2" dir="0.4 -0.65 -0.65" diffuse="0.25 0.25 0.25"
               castshadow="false"/>
        <geom type="plane" size="20 20 0.1" material="floor"/>
      </worldbody>
    </mujoco>""")
    spec.attach(mujoco.MjSpec.from_file(str(xml)), frame=spec.worldbody.add_frame(), prefix="robot/")
    return spec.compile()


def picture(xml: Path, view: View, size: tuple[int, int] = SIZE) -> NDArray[np.uint8]:
    """One view of the robot, as an image (height, width, 3)."""
    width, height = size
    model = scene(xml, width * SCALE, height * SCALE)
    data = mujoco.MjData(model)
    data.qpos[:] = np.deg2rad(view.q)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = view.azimuth, view.elevation, view.distance
    camera.lookat[:] = view.lookat
    options = mujoco.MjvOption()
    options.geomgroup[:] = [1, 1, 1, 0, 0, 0]
    options.sitegroup[:] = 0
    with mujoco.Renderer(model, height * SCALE, width * SCALE) as renderer:
        renderer.update_scene(data, camera, options)
        pixels = renderer.render().astype(float)
    pixels = pixels.reshape(height, SCALE, width, SCALE, 3).mean(axis=(1, 3))
    return np.clip(np.round(pixels), 0, 255).astype(np.uint8)


def main(folder: Path, views: Sequence[View], description: str | None) -> None:
    """Command line of a `picture.py`: draw the views side by side into the documentation."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=Path, default=PICTURES / f"{folder.name}.png")
    out: Path = parser.parse_args().out
    out.parent.mkdir(parents=True, exist_ok=True)
    matplotlib.image.imsave(out, np.hstack([picture(folder / "robot.xml", view) for view in views]))
